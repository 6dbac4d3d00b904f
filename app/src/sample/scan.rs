//! The two scanners: from the body to grids of samples.

use nalgebra::{Rotation3, Unit};
use rayon::prelude::*;
use render::volume::{Affine, Grid, Point, Rescale, Samples, SpaceError, Vector};

use super::SampleError;
use super::body::{Body, Modality, Scanner};
use super::femur::array;
use super::{noise, table as t};

/// Voxels along one edge of the bricks that skip what is far from them.
const BRICK: usize = 8;
/// Seeds of the scanners' noise.
const CT_SEED: u64 = 0xC7;
const MRI_SEED: u64 = 0x31A;

/// Values without noise of a slab of slices that begins at slice `z0`, `[x, y, z]`, x fastest.
fn slab(body: &Body, scanner: &Scanner, hip_from_voxel: &Affine, extent: [usize; 3], z0: usize) -> Vec<f32> {
    let [nx, ny, nz] = extent;
    let depth = BRICK.min(nz - z0);
    let mut values = vec![0.0_f32; nx * ny * depth];
    let linear = hip_from_voxel.linear();
    let step = [0, 1, 2].map(|axis| array(linear.column(axis).into_owned()));
    let spacing = hip_from_voxel.column_lengths();
    let radius = 0.5 * spacing.iter().map(|s| (s * (BRICK - 1) as f64).powi(2)).sum::<f64>().sqrt();
    for y0 in (0..ny).step_by(BRICK) {
        for x0 in (0..nx).step_by(BRICK) {
            let middle = [x0, y0, z0].map(|v| v as f64 + 0.5 * (BRICK - 1) as f64);
            let near = body.near(array(hip_from_voxel.point(&Point::from(middle)).coords), radius);
            for z in 0..depth {
                for y in y0..(y0 + BRICK).min(ny) {
                    let row = array(hip_from_voxel.point(&Point::new(0.0, y as f64, (z0 + z) as f64)).coords);
                    for x in x0..(x0 + BRICK).min(nx) {
                        let f = x as f64;
                        let p = [row[0] + step[0][0] * f, row[1] + step[0][1] * f, row[2] + step[0][2] * f];
                        values[x + nx * (y + ny * z)] = body.value(p, scanner, &near) as f32;
                    }
                }
            }
        }
    }
    values
}

/// All samples of a scan. Slabs are independent, so the bytes are the same for any number of threads.
fn scan<T: Send + Default + Clone>(
    scanner: &Scanner,
    hip_from_voxel: &Affine,
    extent: [usize; 3],
    finish: impl Fn(usize, &[f32], &mut [T]) + Sync,
) -> Vec<T> {
    let body = Body::new();
    let slice = extent[0] * extent[1];
    let mut samples = vec![T::default(); slice * extent[2]];
    samples.par_chunks_mut(slice * BRICK).enumerate().for_each(|(slab_index, out)| {
        let z0 = slab_index * BRICK;
        let values = slab(&body, scanner, hip_from_voxel, extent, z0);
        for (z, (values, out)) in values.chunks(slice).zip(out.chunks_mut(slice)).enumerate() {
            finish(z0 + z, values, out);
        }
    });
    samples
}

/// `hip_from_world`: the origin moves to the head's centre.
fn hip_from_world() -> Affine {
    Affine::translation(-t::head_centre().coords)
}

/// Where the CT's samples lie in world.
pub(super) fn ct_world_from_voxel() -> Result<Affine, SpaceError> {
    let [x, y, z] = t::CT_SPACING_MM;
    let (x, y, z) = (Vector::new(x, 0.0, 0.0), Vector::new(0.0, y, 0.0), Vector::new(0.0, 0.0, z));
    Affine::from_columns(x, y, z, Point::from(t::CT_ORIGIN_MM))
}

pub(super) fn ct() -> Result<Grid, SampleError> {
    let extent = t::CT_EXTENT;
    let world_from_voxel = ct_world_from_voxel()?;
    let scanner = Scanner { modality: Modality::Ct, edge_mm: t::CT_EDGE_MM };
    let finish = |z: usize, values: &[f32], out: &mut [i16]| {
        let mut grain = Vec::new();
        noise::slice(CT_SEED, extent[0], extent[1], z as i64, 4.0, &mut grain);
        for ((out, value), grain) in out.iter_mut().zip(values).zip(&grain) {
            let hu = value + t::CT_NOISE_HU as f32 * grain;
            *out = hu.round().clamp(-1024.0, 3071.0) as i16;
        }
    };
    let samples = scan(&scanner, &(hip_from_world() * world_from_voxel), extent, finish);
    Ok(Grid::new(extent, Samples::I16(samples), Rescale::default(), world_from_voxel)?)
}

/// Where the MRI's samples lie in the MRI's own patient space. Rows run to the left, columns down,
/// slices to the back, all turned by [`t::MRI_OBLIQUE`]; the registration brings this to the CT.
pub(super) fn mri_world_from_voxel() -> Result<Affine, SpaceError> {
    let (axis, angle_deg) = t::MRI_OBLIQUE;
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector::from(axis)), angle_deg.to_radians());
    let [x, y, z] = t::MRI_SPACING_MM;
    let columns = [Vector::x() * x, -Vector::z() * y, Vector::y() * z].map(|c| turn * c);
    let half = t::MRI_EXTENT.map(|n| (n - 1) as f64 * 0.5);
    let centre = t::head_centre() + Vector::from(t::MRI_CENTRE_MM);
    let origin = centre - columns[0] * half[0] - columns[1] * half[1] - columns[2] * half[2];
    let ct_from_voxel = Affine::from_columns(columns[0], columns[1], columns[2], origin)?;
    Ok(t::registration().inverse() * ct_from_voxel)
}

pub(super) fn mri() -> Result<Grid, SampleError> {
    let extent = t::MRI_EXTENT;
    let world_from_voxel = mri_world_from_voxel()?;
    let hip_from_voxel = hip_from_world() * t::registration() * world_from_voxel;
    let scanner = Scanner { modality: Modality::Mri, edge_mm: t::MRI_EDGE_MM };
    let finish = |z: usize, values: &[f32], out: &mut [u16]| {
        let place = |i: usize| ((i % extent[0]) as i64, (i / extent[0]) as i64, z as i64);
        for (i, (out, value)) in out.iter_mut().zip(values).enumerate() {
            let (x, y, z) = place(i);
            // A magnitude picture: the signal lies in one of two noisy channels (Rician).
            let real = value + t::MRI_NOISE as f32 * noise::white(MRI_SEED, x, y, z);
            let imaginary = t::MRI_NOISE as f32 * noise::white(MRI_SEED + 1, x, y, z);
            *out = (real * real + imaginary * imaginary).sqrt().round() as u16;
        }
    };
    let samples = scan(&scanner, &hip_from_voxel, extent, finish);
    Ok(Grid::new(extent, Samples::U16(samples), Rescale::default(), world_from_voxel)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipping_what_is_far_changes_no_value() {
        let body = Body::new();
        let all = body.near([0.0; 3], 1000.0);
        for (scanner, from) in [
            (
                Scanner { modality: Modality::Ct, edge_mm: t::CT_EDGE_MM },
                (hip_from_world() * ct_world_from_voxel().expect("CT pose"), t::CT_EXTENT),
            ),
            (
                Scanner { modality: Modality::Mri, edge_mm: t::MRI_EDGE_MM },
                (
                    hip_from_world() * t::registration() * mri_world_from_voxel().expect("MRI pose"),
                    t::MRI_EXTENT,
                ),
            ),
        ] {
            let (hip_from_voxel, extent) = from;
            for z0 in (0..extent[2]).step_by(BRICK * 3) {
                let values = slab(&body, &scanner, &hip_from_voxel, extent, z0);
                for i in (0..values.len()).step_by(37) {
                    let [x, y] = [i % extent[0], i / extent[0] % extent[1]];
                    let z = z0 + i / (extent[0] * extent[1]);
                    let p = hip_from_voxel.point(&Point::new(x as f64, y as f64, z as f64));
                    let full = body.value(array(p.coords), &scanner, &all);
                    assert!((full - f64::from(values[i])).abs() < 0.01, "{full} and {} at {p}", values[i]);
                }
            }
        }
    }
}
