//! `section`: a flat picture of a case through the original samples and cells, with the lines of cutters and implants.

use std::collections::BTreeMap;

use ::render::section::{self, Layer, Section, SectionError, Slab, SlabMode};
use ::render::volume::{Point, Vector};
use image::ImageEncoder as _;

use super::{Failure, check_folder, input, write_file};
use crate::cli::{PlaneName, SectionArgs, SlabName};
use crate::{scene, sections};

/// Colour of cutters' lines.
const CUTTER: [u8; 3] = [236, 112, 208];

/// Draws the section.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &SectionArgs) -> Result<(), Failure> {
    let is_png = args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if !is_png {
        let fault = "the picture's name must end in .png";
        return Err(Failure::Usage(format!("{fault}; change --out: {}", args.out.display())));
    }
    check_folder(&args.out)?;
    let input = input::open(&args.input)?;
    let layers = sections::layers(&input.case, &input.assets, &BTreeMap::new());
    let drawn = scene::scene(&input.case, &input.assets);
    let Some(bounds) = scene::bounds(&drawn) else {
        let fault = "the case shows nothing; make a volume, an implant or a grid visible";
        return Err(Failure::Unfit(format!("{fault}: {}", args.input.display())));
    };
    let section = section_of(args, bounds).map_err(|error| Failure::Usage(error.to_string()))?;
    let mut bytes = section::picture(&section, &layers, &drawn.grids, input.case.background);
    let reach_mm = (bounds[1] - bounds[0]).norm() + (section.centre() - bounds[0]).norm();
    lines(&input, &layers, &section, reach_mm, &mut bytes);
    let mut file = Vec::new();
    image::codecs::png::PngEncoder::new(&mut file)
        .write_image(&bytes, args.size[0], args.size[1], image::ExtendedColorType::Rgba8)
        .map_err(|e| Failure::Other(format!("the picture cannot be made into PNG ({e})")))?;
    write_file(&args.out, &file)
}

fn section_of(args: &SectionArgs, bounds: [Point; 2]) -> Result<Section, SectionError> {
    let centre = args.at.map_or_else(|| nalgebra::center(&bounds[0], &bounds[1]), Point::from);
    let size = args.size.map(|n| n as usize);
    let [right, down] = match args.plane {
        PlaneName::Axial => [Vector::x(), Vector::y()],
        PlaneName::Coronal => [Vector::x(), -Vector::z()],
        PlaneName::Sagittal => [Vector::y(), -Vector::z()],
        PlaneName::Along(direction) => axes(Vector::from(direction)),
    };
    let whole = Section::new(centre, right, down, 1.0, size)?;
    let mm_per_pixel = args.mm_per_pixel.unwrap_or_else(|| fit(&whole, bounds));
    let mode = match args.mode {
        SlabName::Mean => SlabMode::Mean,
        SlabName::Mip => SlabMode::Mip,
        SlabName::MinIp => SlabMode::MinIp,
    };
    Section::new(centre, right, down, mm_per_pixel, size)?
        .with_slab(Slab { thickness_mm: args.thickness, mode })
}

/// Towards the picture's right and lower edge for a direction of view: the feet are below, or, where one looks
/// more along the body than across it, the back is.
fn axes(direction: Vector) -> [Vector; 2] {
    let along_body = direction.z.abs() > direction.xy().norm();
    let down = if along_body { Vector::y() } else { -Vector::z() };
    let right = down.cross(&direction);
    [right, direction.cross(&right)]
}

/// Millimetres per pixel at which a box fits, seen from the section's middle.
fn fit(section: &Section, [low, high]: [Point; 2]) -> f64 {
    let [width, height] = section.size();
    let corner = |c: usize| {
        let at = |axis: usize| if c >> axis & 1 == 1 { high[axis] } else { low[axis] };
        Point::new(at(0), at(1), at(2)) - section.centre()
    };
    let reach = |along: Vector| (0..8).map(|c| corner(c).dot(&along).abs()).fold(0.0, f64::max);
    let across = 2.0 * reach(section.right()) / width as f64;
    let along = 2.0 * reach(section.down()) / height as f64;
    across.max(along).max(1e-6)
}

/// Cutters and implants over the picture.
fn lines(input: &input::Input, layers: &[Layer], section: &Section, reach_mm: f64, bytes: &mut [u8]) {
    for line in sections::cutter_lines(&input.case, layers, section, reach_mm) {
        for pair in line.windows(2) {
            stroke(section, [pair[0], pair[1]], CUTTER, bytes);
        }
    }
    for implant in input.case.implants.iter().filter(|i| i.visible) {
        let Some(mesh) = input.assets.mesh(implant) else { continue };
        let color = implant.color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
        let pose = scene::world_from_model(implant);
        for piece in section::mesh_outline(section, mesh, &pose) {
            stroke(section, piece, color, bytes);
        }
    }
}

/// Colours the pixels that a line passes, at steps of half a pixel.
fn stroke(section: &Section, [from, to]: [Point; 2], color: [u8; 3], bytes: &mut [u8]) {
    let [width, height] = section.size();
    let ([x0, y0], [x1, y1]) = (section.pixel(&from), section.pixel(&to));
    let Some([a, b]) = clipped([[x0, y0], [x1, y1]], [width as f64, height as f64]) else { return };
    let steps = ((b[0] - a[0]).abs().max((b[1] - a[1]).abs()) * 2.0).ceil().max(1.0) as usize;
    for step in 0..=steps {
        let part = step as f64 / steps as f64;
        let (x, y) = (a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part);
        if x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64 {
            let at = 4 * (x as usize + width * y as usize);
            bytes[at..at + 3].copy_from_slice(&color);
        }
    }
}

/// The part of a line inside a rectangle from the origin (Liang and Barsky 1984).
fn clipped([from, to]: [[f64; 2]; 2], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let along = to[axis] - from[axis];
        if along == 0.0 {
            if from[axis] < 0.0 || from[axis] > size[axis] {
                return None;
            }
            continue;
        }
        let (a, b) = (-from[axis] / along, (size[axis] - from[axis]) / along);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    let at = |part: f64| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part);
    (first <= last).then(|| [at(first), at(last)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_of_view_keeps_the_body_upright() {
        for (direction, right, down) in [
            (Vector::z(), Vector::x(), Vector::y()),
            (Vector::y(), Vector::x(), -Vector::z()),
            (-Vector::x(), Vector::y(), -Vector::z()),
        ] {
            assert_eq!(axes(direction), [right, down], "as the plane of that name");
        }
        let [right, down] = axes(Vector::new(0.3, 1.0, 0.4));
        let section = Section::new(Point::origin(), right, down, 1.0, [2, 2]).expect("a section");
        let forward = Vector::new(0.3, 1.0, 0.4).normalize();
        let apart = section.forward() - forward;
        assert!(section.down().z < -0.9, "feet below");
        assert!(section.right().dot(&forward).abs() < 1e-12, "right is across the view");
        assert!(apart.norm() < 1e-9, "it looks along the direction: {}", section.forward());
    }

    #[test]
    fn a_line_is_drawn_as_far_as_the_picture_goes() {
        let section =
            Section::new(Point::origin(), Vector::x(), Vector::y(), 1.0, [8, 4]).expect("a section");
        let mut bytes = vec![0; 8 * 4 * 4];
        let far = 1e7;
        stroke(&section, [Point::new(-far, 0.5, 0.0), Point::new(far, 0.5, 0.0)], [9, 9, 9], &mut bytes);
        let drawn: Vec<usize> = (0..32).filter(|i| bytes[4 * i] == 9).collect();
        assert_eq!(drawn, (16..24).collect::<Vec<_>>(), "one row");
    }
}
