//! Separation of a payload into planes that compress better apart, and back.
//!
//! An LZ codec sees one run of bytes. In a payload of end points and tables, like stands beside unlike: the same byte
//! of successive elements is likelier to repeat than the next byte of one element. A plane is all first bytes (or
//! words) of the elements, then all second ones, and so on; elements keep their order.
//!
//! Differences against the left neighbour and against the sub-volume before (as numbers, as fields, by exclusive
//! or) were tried on real series and made payloads larger for every codec, so there is no such transform here.

/// A run of equal elements in a payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Section {
    elements: usize,
    element_bytes: usize,
}

/// What a payload is made of: one or two runs of equal elements, in the payload's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    sections: [Section; 2],
}

impl Shape {
    /// A payload of `elements` elements of `element_bytes` bytes each.
    pub fn new(elements: usize, element_bytes: usize) -> Self {
        let none = Section { elements: 0, element_bytes: 1 };
        Self { sections: [Section { elements, element_bytes }, none] }
    }

    /// The same payload, followed by `elements` elements of `element_bytes` bytes each.
    pub fn then(self, elements: usize, element_bytes: usize) -> Self {
        Self { sections: [self.sections[0], Section { elements, element_bytes }] }
    }

    /// Bytes of the payload; the largest number there is where they cannot be counted.
    pub fn bytes(self) -> usize {
        let [first, second] =
            self.sections.map(|section| section.elements.saturating_mul(section.element_bytes));
        first.saturating_add(second)
    }
}

/// Into which planes a payload is separated. The ids stand in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Planes {
    /// None: the payload as it is.
    AsIs,
    /// One for each 4-byte word of an element: the end points apart from the indices of BC1, the slices of a table
    /// apart from each other.
    Words,
    /// One for each byte of an element.
    Bytes,
}

impl Planes {
    /// All, in the order of their ids.
    pub const ALL: [Self; 3] = [Self::AsIs, Self::Words, Self::Bytes];

    /// The id that stands in files.
    pub fn id(self) -> u8 {
        match self {
            Self::AsIs => 0,
            Self::Words => 1,
            Self::Bytes => 2,
        }
    }

    /// What `id` stands for; none if nothing.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|planes| planes.id() == id)
    }

    /// A short name: `"as is"`, `"words"`, `"bytes"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::AsIs => "as is",
            Self::Words => "words",
            Self::Bytes => "bytes",
        }
    }

    /// Bytes of what goes into one plane together, for elements of so many bytes. Elements that are no whole number
    /// of such units, or only one, stay as they are.
    fn unit(self, element_bytes: usize) -> usize {
        match self {
            Self::Words if element_bytes.is_multiple_of(4) => 4,
            Self::AsIs | Self::Words => element_bytes,
            Self::Bytes => 1,
        }
    }

    /// Whether separation leaves a payload of this shape as it is.
    pub(super) fn leaves(self, shape: Shape) -> bool {
        shape
            .sections
            .iter()
            .all(|section| section.elements <= 1 || self.unit(section.element_bytes) == section.element_bytes)
    }

    /// Separates `payload` into `planar`; both have the shape's bytes.
    pub(super) fn separate(self, shape: Shape, payload: &[u8], planar: &mut [u8]) {
        self.each_section(shape, payload, planar, |units, unit, from, to| match (unit, units) {
            (1, 2) => separate::<1, 2>(from, to),
            (1, 4) => separate::<1, 4>(from, to),
            (1, 8) => separate::<1, 8>(from, to),
            (1, 16) => separate::<1, 16>(from, to),
            (1, 32) => separate::<1, 32>(from, to),
            (4, 2) => separate::<4, 2>(from, to),
            (4, 4) => separate::<4, 4>(from, to),
            (4, 8) => separate::<4, 8>(from, to),
            _ => to.copy_from_slice(from),
        });
    }

    /// Puts the planes together again: the inverse of [`Planes::separate`].
    pub(super) fn join(self, shape: Shape, planar: &[u8], payload: &mut [u8]) {
        self.each_section(shape, planar, payload, |units, unit, from, to| match (unit, units) {
            (1, 2) => join::<1, 2>(from, to),
            (1, 4) => join::<1, 4>(from, to),
            (1, 8) => join::<1, 8>(from, to),
            (1, 16) => join::<1, 16>(from, to),
            (1, 32) => join::<1, 32>(from, to),
            (4, 2) => join::<4, 2>(from, to),
            (4, 4) => join::<4, 4>(from, to),
            (4, 8) => join::<4, 8>(from, to),
            _ => to.copy_from_slice(from),
        });
    }

    /// Calls `each` with the units of an element, the bytes of a unit, and the two sides of every section.
    fn each_section(
        self,
        shape: Shape,
        mut from: &[u8],
        mut to: &mut [u8],
        each: impl Fn(usize, usize, &[u8], &mut [u8]),
    ) {
        debug_assert!(
            from.len() == shape.bytes() && to.len() == shape.bytes(),
            "both have the shape's bytes"
        );
        for Section { elements, element_bytes } in shape.sections {
            let bytes = elements.saturating_mul(element_bytes).min(from.len()).min(to.len());
            let (part, rest) = from.split_at(bytes);
            let (out, rest_out) = to.split_at_mut(bytes);
            let unit = self.unit(element_bytes).max(1);
            each(element_bytes / unit, unit, part, out);
            (from, to) = (rest, rest_out);
        }
    }
}

/// Separates elements of `UNITS` units of `UNIT` bytes.
fn separate<const UNIT: usize, const UNITS: usize>(payload: &[u8], planar: &mut [u8]) {
    let elements = payload.as_chunks::<UNIT>().0.as_chunks::<UNITS>().0;
    let planes = planar.as_chunks_mut::<UNIT>().0;
    for (which, plane) in planes.chunks_exact_mut(elements.len().max(1)).enumerate() {
        for (unit, element) in plane.iter_mut().zip(elements) {
            *unit = element[which];
        }
    }
}

/// Puts elements of `UNITS` units of `UNIT` bytes together.
fn join<const UNIT: usize, const UNITS: usize>(planar: &[u8], payload: &mut [u8]) {
    /// Elements that are put together at a time: in registers and the nearest cache.
    const RUN: usize = 64;
    let elements = payload.as_chunks_mut::<UNIT>().0.as_chunks_mut::<UNITS>().0;
    let planes = planar.as_chunks::<UNIT>().0;
    let count = elements.len();
    let mut start = 0;
    for run in elements.chunks_mut(RUN) {
        let mut units = [[[0; UNIT]; RUN]; UNITS];
        for (which, units) in units.iter_mut().enumerate() {
            let from = which * count + start;
            units[..run.len()].copy_from_slice(&planes[from..from + run.len()]);
        }
        for (i, element) in run.iter_mut().enumerate() {
            for (unit, units) in element.iter_mut().zip(&units) {
                *unit = units[i];
            }
        }
        start += run.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Shape> {
        let mut shapes = Vec::new();
        for elements in [1, 2, 63, 64, 65, 1000] {
            shapes.extend([1, 2, 4, 8, 16, 32, 3, 12].map(|bytes| Shape::new(elements, bytes)));
            shapes.extend([4, 8, 16, 32].map(|bytes| Shape::new(elements, 4).then(elements, bytes)));
        }
        shapes
    }

    #[test]
    fn joined_planes_are_the_payload_again() {
        for shape in shapes() {
            let payload: Vec<u8> = (0..shape.bytes()).map(|i| (i * 7 + i / 251) as u8).collect();
            for planes in Planes::ALL {
                let mut planar = vec![0; payload.len()];
                planes.separate(shape, &payload, &mut planar);
                let mut joined = vec![0; payload.len()];
                planes.join(shape, &planar, &mut joined);
                assert_eq!(joined, payload, "{planes:?} of {shape:?}");
                assert!(!planes.leaves(shape) || planar == payload, "{planes:?} says it leaves {shape:?}");
            }
        }
    }

    #[test]
    fn planes_are_those_of_the_format_page() {
        // Two heads of 4 bytes, two tables of 8.
        let shape = Shape::new(2, 4).then(2, 8);
        let payload: Vec<u8> = (0..24).collect();
        let separated = |planes: Planes| {
            let mut planar = vec![0; 24];
            planes.separate(shape, &payload, &mut planar);
            planar
        };
        let words = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15, 20, 21, 22, 23];
        assert_eq!(separated(Planes::Words), words, "words");
        let bytes = [0, 4, 1, 5, 2, 6, 3, 7, 8, 16, 9, 17, 10, 18, 11, 19, 12, 20, 13, 21, 14, 22, 15, 23];
        assert_eq!(separated(Planes::Bytes), bytes, "bytes");
    }

    #[test]
    fn ids_are_those_of_the_format_page() {
        assert_eq!(Planes::ALL.map(Planes::id), [0, 1, 2], "ids");
        assert_eq!(Planes::from_id(3), None, "an id that is not known");
    }
}
