//! Windows by name, and what a drag does to one.

use crate::host::context::Window;

/// A named window; HU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedWindow {
    /// For people.
    pub name: &'static str,
    /// What it shows.
    pub window: Window,
}

/// The usual ones for CT.
pub const CT_WINDOWS: [NamedWindow; 4] = [
    NamedWindow { name: "Bone", window: Window { level: 350.0, width: 1800.0 } },
    NamedWindow { name: "Soft tissue", window: Window { level: 40.0, width: 400.0 } },
    NamedWindow { name: "Lung", window: Window { level: -600.0, width: 1500.0 } },
    NamedWindow { name: "Metal", window: Window { level: 1500.0, width: 5000.0 } },
];

/// The window from the least to the greatest value; at least a unit wide.
pub fn whole(range: [f64; 2]) -> Window {
    let [low, high] = range;
    let width = if high > low { high - low } else { 1.0 };
    Window { level: low + width / 2.0, width }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_window_reaches_from_black_to_white() {
        let window = whole([-1000.0, 3000.0]);
        assert_eq!((window.grey(-1000.0), window.grey(3000.0)), (0.0, 1.0), "both ends");
        assert_eq!(whole([7.0, 7.0]).grey(7.0), 0.0, "a flat volume divides by no zero");
    }
}
