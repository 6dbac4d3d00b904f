//! One named quantity on the points or the cells of a grid.

/// Values as the file stored them, tuple after tuple: component fastest.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// 32-bit float, and whole numbers of at most 16 bits.
    F32(Vec<f32>),
    /// 64-bit float, and whole numbers of 32 bits and more (exact to 2⁵³).
    F64(Vec<f64>),
}

impl Values {
    /// How many numbers there are, over all components.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number `index` of all; it must lie inside.
    pub fn at(&self, index: usize) -> f64 {
        match self {
            Self::F32(v) => f64::from(v[index]),
            Self::F64(v) => v[index],
        }
    }

    /// Each number in turn.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).map(|index| self.at(index))
    }
}

/// A named quantity with one tuple of components a point or a cell; units are the file's own.
///
/// Values may be NaN or infinite; they are counted, and ranges leave them out.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    name: String,
    components: usize,
    values: Values,
    ranges: Vec<Option<[f64; 2]>>,
    lengths: Option<[f64; 2]>,
    non_finite: usize,
}

impl Field {
    /// A field of `components` numbers a tuple. Whether there is a tuple for each point or cell is
    /// checked by the grid that takes it.
    pub fn new(name: String, components: usize, values: Values) -> Self {
        let mut ranges: Vec<Option<[f64; 2]>> = vec![None; components.min(values.len())];
        let mut non_finite = 0;
        for (index, value) in values.iter().enumerate() {
            if !value.is_finite() {
                non_finite += 1;
            } else if let Some(range) = index.checked_rem(components).and_then(|c| ranges.get_mut(c)) {
                let [low, high] = range.unwrap_or([value; 2]);
                *range = Some([low.min(value), high.max(value)]);
            }
        }
        let mut field = Self { name, components, values, ranges, lengths: None, non_finite };
        let tuples = field.values.len().checked_div(components).unwrap_or(0);
        let lengths = (0..tuples).map(|tuple| field.magnitude(tuple)).filter(|v| v.is_finite());
        field.lengths = lengths.map(|v| [v; 2]).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        field
    }

    /// What the file calls it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Numbers a tuple: 1 for a scalar, 3 for a vector, 6 or 9 for a tensor.
    pub fn components(&self) -> usize {
        self.components
    }

    /// All numbers, component fastest.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// One component of one tuple; both must lie inside.
    pub fn value(&self, tuple: usize, component: usize) -> f64 {
        self.values.at(tuple * self.components + component)
    }

    /// Length of one tuple as a vector; the value's size for a scalar.
    pub fn magnitude(&self, tuple: usize) -> f64 {
        (0..self.components).map(|c| self.value(tuple, c).powi(2)).sum::<f64>().sqrt()
    }

    /// Least and greatest finite value of a component; nothing where there is none.
    pub fn range(&self, component: usize) -> Option<[f64; 2]> {
        self.ranges.get(component).copied().flatten()
    }

    /// Least and greatest finite length of a tuple; nothing where there is none.
    pub fn length_range(&self) -> Option<[f64; 2]> {
        self.lengths
    }

    /// How many values are NaN or infinite.
    pub fn non_finite(&self) -> usize {
        self.non_finite
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_component_has_its_own_range() {
        let values = Values::F64(vec![1.0, -4.0, 3.0, f64::INFINITY, -5.0, 0.0]);
        let field = Field::new("u".to_owned(), 3, values);
        assert_eq!(field.range(0), Some([1.0, 1.0]), "infinite left out");
        assert_eq!(field.range(1), Some([-5.0, -4.0]), "second component");
        assert_eq!((field.range(2), field.range(3)), (Some([0.0, 3.0]), None), "third, and none beyond");
        assert_eq!((field.non_finite(), field.value(1, 1)), (1, -5.0), "counted; tuple 1, component 1");
        assert!((field.magnitude(0) - 26.0_f64.sqrt()).abs() < 1e-15, "length of (1, -4, 3)");
    }

    #[test]
    fn a_field_of_no_component_does_not_divide_by_zero() {
        let field = Field::new("u".to_owned(), 0, Values::F32(vec![1.0]));
        assert_eq!(field.range(0), None, "no range");
    }
}
