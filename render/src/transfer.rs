//! Transfer functions as the shaders read them: tables of extinction and of its antiderivative.

use crate::volume::Transfer;

/// Entries of a table.
pub(crate) const NODES: usize = 4096;
/// Nodes below the first value, and above the last.
const ROOM: usize = 4;
/// Rows a table takes: extinction, and its antiderivative in two parts.
pub(crate) const ROWS: usize = 3;

/// One transfer function over evenly spaced values; between two nodes everything is linear.
///
/// A texel is (τ·red, τ·green, τ·blue, τ), τ in 1/mm. The antiderivative is over the table position, and
/// stands as a rounded `f32` and the rest, so that differences of it keep 24 digits more. Error: the true τ
/// between two nodes departs from the line by at most the function's curvature over 1/4000 of the span of values that occur.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    /// Value of the first node.
    pub(crate) first: f64,
    /// Value between two nodes.
    pub(crate) step: f64,
    /// [`ROWS`] rows of [`NODES`] texels.
    pub(crate) texels: Vec<[f32; 4]>,
}

impl Table {
    /// The table of a function over the values between `least` and `greatest` that a grid has.
    pub(crate) fn new(transfer: &Transfer, [least, greatest]: [f64; 2]) -> Self {
        let points = transfer.points();
        // Beyond its points the function is constant, beyond the grid's range it is never asked.
        let low = points[0].value.clamp(least, greatest);
        let high = points[points.len() - 1].value.clamp(least, greatest);
        // Some nodes of room beyond either end, so that a jump there is inside the table. Both ends are nodes
        // themselves: what is at a jump there, a whole volume of one value perhaps, is on its later side.
        let inner = (NODES - 1 - 2 * ROOM) as f64;
        let step = if high > low { (high - low) / inner } else { 1.0 / ROOM as f64 };
        let first = low - step * ROOM as f64;
        // The ends are met without rounding.
        let value = |j: usize| match j {
            ROOM => low,
            j if j + ROOM + 1 == NODES => high,
            j => first + step * j as f64,
        };
        let node = |j: usize| {
            let (c, tau) = transfer.classify(value(j));
            [c[0] * tau, c[1] * tau, c[2] * tau, tau]
        };
        let nodes: Vec<[f64; 4]> = (0..NODES).map(node).collect();
        let mut texels = vec![[0.0_f32; 4]; ROWS * NODES];
        let mut sum = [0.0_f64; 4];
        for (j, value) in nodes.iter().enumerate() {
            if j > 0 {
                sum = std::array::from_fn(|c| sum[c] + 0.5 * (nodes[j - 1][c] + value[c]));
            }
            let high = sum.map(|s| s as f32);
            texels[j] = value.map(|v| v as f32);
            texels[NODES + j] = high;
            texels[2 * NODES + j] = std::array::from_fn(|c| (sum[c] - f64::from(high[c])) as f32);
        }
        Self { first, step, texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::ControlPoint;

    #[test]
    fn values_that_do_not_occur_take_no_nodes() {
        let point = |value, a| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        let transfer =
            Transfer::new(vec![point(-1e6, 0.0), point(0.0, 0.0), point(1.0, 0.5), point(1e6, 0.5)], 1.0);
        let table = Table::new(&transfer.expect("transfer"), [-2.0, 2.0]);
        assert!(table.step < 0.01, "one unit of the ramp has hundreds of nodes: {}", table.step);
    }

    #[test]
    fn a_jump_at_the_end_of_the_range_belongs_to_its_later_point() {
        let point = |value, a| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        let jump = |at| Transfer::new(vec![point(at, 0.9), point(at, 0.5)], 1.0).expect("transfer");
        let known = -(0.5_f64).ln();
        for (at, range, node) in
            [(0.1, [0.1, 0.1], ROOM), (-7.3, [-7.3, 4.0], ROOM), (0.7, [-3.0, 0.7], NODES - 1 - ROOM)]
        {
            let points = [point(-1e3, 0.9), point(1e3, 0.5)];
            let mut all = vec![points[0]];
            all.extend(jump(at).points());
            all.push(points[1]);
            let table = Table::new(&Transfer::new(all, 1.0).expect("transfer"), range);
            assert!((f64::from(table.texels[node][3]) - known).abs() < 1e-6, "at {at}");
            let place = (at - table.first) / table.step;
            assert!((place - node as f64).abs() < 1e-6, "{at} is node {node}, not {place}");
        }
    }

    #[test]
    fn the_antiderivative_differs_by_the_integral() {
        let point = |value, a| ControlPoint { value, rgba: [1.0, 0.25, 0.0, a] };
        let transfer = Transfer::new(vec![point(-1000.0, 0.9), point(0.0, 0.0), point(3000.0, 0.001)], 1.0)
            .expect("transfer");
        let table = Table::new(&transfer, [-1e9, 1e9]);
        let whole =
            |j: usize| f64::from(table.texels[NODES + j][3]) + f64::from(table.texels[2 * NODES + j][3]);
        // Faint values after a dense stretch: where single precision would have lost them.
        let (a, b) = (3000, 3005);
        let mean = (whole(b) - whole(a)) / 5.0;
        let value = |j: f64| table.first + table.step * j;
        let truth = transfer.extinction_of(transfer.rgba(value(3002.5))[3]);
        assert!((mean / truth - 1.0).abs() < 1e-6, "{mean} is not {truth}");
    }
}
