//! Proxy polygons: what a slab of the stack holds of a convex solid, as seen in the picture.

use crate::view::View;
use crate::volume::{Point, convex::ConvexSolid};

/// A convex polygon in normalised coordinates, counter-clockwise; empty where nothing is to be drawn.
pub(crate) type Polygon = Vec<[f64; 2]>;

/// How far a polygon reaches beyond what it covers, in pixels: the rasteriser rounds corners to 1/256,
/// and a pixel whose centre lies on an edge must not be lost.
const MARGIN_PIXELS: f64 = 0.05;

/// The edges of a solid in view space, each once, with its depth.
#[derive(Debug, Clone)]
pub(crate) struct Proxy {
    edges: Vec<(Point, Point)>,
    /// Least and greatest depth, mm from the eye's plane.
    pub(crate) depth: [f64; 2],
}

impl Proxy {
    /// `None` for an empty solid.
    pub(crate) fn new(solid_in_view: &ConvexSolid) -> Option<Self> {
        let [low, high] = solid_in_view.bounds()?;
        let order = |p: &Point| [p.x, p.y, p.z];
        let once = |(a, b): &(&Point, &Point)| order(a) <= order(b);
        let edges = solid_in_view.edges().filter(once).map(|(a, b)| (*a, *b)).collect();
        Some(Self { edges, depth: [low.z, high.z] })
    }

    /// The polygon of the part between two depths.
    pub(crate) fn polygon(&self, view: &View, near_mm: f64, far_mm: f64) -> Polygon {
        if self.depth[1] < near_mm || self.depth[0] > far_mm {
            return Polygon::new();
        }
        let margin = [0, 1].map(|a| 2.0 * MARGIN_PIXELS / f64::from(view.size[a]));
        let mut points: Polygon = Vec::with_capacity(4 * self.edges.len());
        let mut at_eye = false;
        let mut add = |p: Point| match view.ndc(&p) {
            // The sum with a small square: the hull of the four corners holds the margin everywhere.
            Some([x, y]) => points.extend(
                [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
                    .map(|s| [x + s[0] * margin[0], y + s[1] * margin[1]]),
            ),
            None => at_eye = true,
        };
        for (a, b) in &self.edges {
            for p in [a, b] {
                if (near_mm..=far_mm).contains(&p.z) {
                    add(*p);
                }
            }
            for depth in [near_mm, far_mm] {
                if (a.z < depth) != (b.z < depth) {
                    add(a + (b - a) * ((depth - a.z) / (b.z - a.z)));
                }
            }
        }
        if at_eye {
            return vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        }
        clipped(hull(points), [[-1.0, 1.0]; 2])
    }
}

/// The convex hull, counter-clockwise (Andrew's monotone chain).
pub(crate) fn hull(mut points: Polygon) -> Polygon {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return Polygon::new();
    }
    let turn =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let mut chain: Polygon = Vec::with_capacity(2 * points.len());
    let half = |chain: &mut Polygon, points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let floor = chain.len();
        for &p in points {
            while chain.len() >= floor + 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
    };
    half(&mut chain, &mut points.iter());
    half(&mut chain, &mut points.iter().rev());
    if chain.len() < 3 { Polygon::new() } else { chain }
}

/// What of a convex polygon lies between low and high x and y.
pub(crate) fn clipped(mut polygon: Polygon, rectangle: [[f64; 2]; 2]) -> Polygon {
    for (axis, [low, high]) in rectangle.into_iter().enumerate() {
        for (sign, bound) in [(1.0, -low), (-1.0, high)] {
            let inside = |p: &[f64; 2]| bound + sign * p[axis];
            if polygon.iter().all(|p| inside(p) >= 0.0) {
                continue;
            }
            let mut kept = Vec::with_capacity(polygon.len() + 2);
            for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
                let (va, vb) = (inside(a), inside(b));
                if va >= 0.0 {
                    kept.push(*a);
                }
                if (va >= 0.0) != (vb >= 0.0) {
                    let t = va / (va - vb);
                    kept.push([a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]);
                }
            }
            polygon = kept;
        }
    }
    polygon
}

/// Least and greatest x and y of a polygon.
pub(crate) fn bounds(polygon: &Polygon) -> [[f64; 2]; 2] {
    polygon.iter().fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], p| {
        [[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Projection};
    use crate::volume::Vector;

    fn view() -> View {
        let camera = Camera {
            eye: Point::origin(),
            target: Point::new(0.0, 0.0, 1.0),
            up: Vector::y(),
            projection: Projection::Perspective { fov_rad: std::f64::consts::FRAC_PI_2 },
        };
        View::new(&camera, [100, 100]).expect("view")
    }

    fn area(p: &Polygon) -> f64 {
        let pairs = p.iter().zip(p.iter().cycle().skip(1));
        pairs.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
    }

    #[test]
    fn a_slab_of_a_box_is_seen_at_its_near_face() {
        let solid = ConvexSolid::from_box(Point::new(-1.0, -1.0, 4.0), Point::new(1.0, 1.0, 8.0));
        let proxy = Proxy::new(&solid).expect("proxy");
        let polygon = proxy.polygon(&view(), 5.0, 6.0);
        let side = 2.0 * (1.0 / 5.0 + 2.0 * MARGIN_PIXELS / 100.0);
        assert!((area(&polygon) - side * side).abs() < 1e-12, "area {}", area(&polygon));
        assert!(proxy.polygon(&view(), 9.0, 10.0).is_empty(), "behind the box");
    }

    #[test]
    fn around_the_eye_the_whole_picture_is_covered() {
        let solid = ConvexSolid::from_box(Point::new(-1.0, -1.0, -1.0), Point::new(1.0, 1.0, 1.0));
        let proxy = Proxy::new(&solid).expect("proxy");
        assert_eq!(area(&proxy.polygon(&view(), 0.0, 0.5)), 4.0, "all of it");
    }

    #[test]
    fn a_corner_is_clipped_off() {
        let diamond = vec![[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        let quarter = clipped(diamond.clone(), [[0.0, 2.0], [0.0, 2.0]]);
        assert!((area(&quarter) - 0.5).abs() < 1e-12, "a quarter of it: {quarter:?}");
        assert!(clipped(diamond, [[0.6, 2.0], [0.6, 2.0]]).is_empty(), "beside it");
    }
}
