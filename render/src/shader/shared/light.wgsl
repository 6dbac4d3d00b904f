// The light at the eye. The numbers are those of `scene::light`; a test compares them.

const AMBIENT: f32 = 0.3;
const DIFFUSE: f32 = 0.7;
const SPECULAR: f32 = 0.2;
const SHININESS: f32 = 20.0;
const FLAT: f32 = 1e-3;

// A display colour lit from the eye; `facing` is |n·v|.
fn lit(color: vec3<f32>, facing: f32) -> vec3<f32> {
    let highlight = SPECULAR * pow(facing, SHININESS);
    return clamp(color * (AMBIENT + DIFFUSE * facing) + highlight, vec3<f32>(0.0), vec3<f32>(1.0));
}
