//! Transfer functions by name: `assets/presets.json`, and which of them a new volume gets.
//!
//! A CT preset's values are HU. An MR preset's run 0 to 1 over the grid's range, for MR has no fixed
//! scale.

use std::sync::OnceLock;

use render::volume::{ControlPoint, Transfer, TransferError};
use serde::Deserialize;

/// What is shipped.
const JSON: &str = include_str!("../../assets/presets.json");

/// The one used for CT, and for what says nothing but has values as low as air's.
pub const DEFAULT_CT: &str = "CT-Bone";
/// The one used for everything else.
pub const DEFAULT_MR: &str = "MR-Default";

/// A named transfer function.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// For people and for the command line: `"CT-Bone"`.
    pub name: String,
    /// What it is good for, in a clause.
    pub about: String,
    /// Whether values run 0 to 1 over the grid's range.
    pub relative: bool,
    /// The thickness that the opacities are of; mm.
    pub unit_mm: f64,
    /// `[value, r, g, b, a]`, by rising value.
    pub points: Vec<[f64; 5]>,
}

/// Values below this are air in HU; no other modality stores them by default.
const AIR_BELOW: f64 = -500.0;

impl Preset {
    /// The transfer function for values of `range` (least and greatest; used where the preset is
    /// relative). A range without width, or not finite, counts as one unit wide.
    ///
    /// # Errors
    /// [`TransferError`] where the points are none; never for those of [`presets`].
    pub fn transfer(&self, range: [f64; 2]) -> Result<Transfer, TransferError> {
        let [low, high] = range;
        let width = if high > low && (high - low).is_finite() { high - low } else { 1.0 };
        let low = if low.is_finite() { low } else { 0.0 };
        let place = |v: f64| if self.relative { low + v * width } else { v };
        let point = |p: &[f64; 5]| ControlPoint { value: place(p[0]), rgba: [p[1], p[2], p[3], p[4]] };
        Transfer::new(self.points.iter().map(point).collect(), self.unit_mm)
    }
}

/// All presets, in the order shown. A test holds that what is shipped can be read; were it broken, the
/// list would be empty.
pub fn presets() -> &'static [Preset] {
    static PRESETS: OnceLock<Vec<Preset>> = OnceLock::new();
    PRESETS.get_or_init(|| {
        serde_json::from_str(JSON).unwrap_or_else(|error| {
            log::error!("assets/presets.json is broken: {error}; build the program again from its sources");
            Vec::new()
        })
    })
}

/// The preset of that name, whatever the case of its letters.
pub fn by_name(name: &str) -> Option<&'static Preset> {
    presets().iter().find(|p| p.name.eq_ignore_ascii_case(name))
}

/// What a volume is drawn with before anybody has chosen.
///
/// [`DEFAULT_CT`] where its file says CT, or says nothing and has values as low as air's; [`DEFAULT_MR`]
/// otherwise. `modality` as DICOM writes it; `range` is the grid's least and greatest value.
pub fn default_for(modality: Option<&str>, range: [f64; 2]) -> Transfer {
    let is_ct = modality.map_or(range[0] < AIR_BELOW, |m| m.eq_ignore_ascii_case("CT"));
    let name = if is_ct { DEFAULT_CT } else { DEFAULT_MR };
    by_name(name).and_then(|p| p.transfer(range).ok()).unwrap_or_else(|| plain(range))
}

/// Grey over the range: what is left where the list is broken.
fn plain(range: [f64; 2]) -> Transfer {
    let point = |value: f64, v: f64| ControlPoint { value, rgba: [v, v, v, v * 0.2] };
    let finite = |v: f64| if v.is_finite() { v } else { 0.0 };
    let low = finite(range[0]);
    match Transfer::new(vec![point(low, 0.0), point(finite(range[1]).max(low), 1.0)], 1.0) {
        Ok(transfer) => transfer,
        // Finite values that rise, components within 0 to 1 and a positive unit are always accepted.
        Err(_) => unreachable!("a grey ramp is a transfer function"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_preset_is_a_transfer_function_and_shows_something() {
        let list: Vec<Preset> = serde_json::from_str(JSON).expect("the shipped list can be read");
        assert!(list.len() >= 12, "only {} presets", list.len());
        for preset in &list {
            let t = preset.transfer([-3.0, 17.0]).unwrap_or_else(|e| panic!("{}: {e}", preset.name));
            assert!(t.points().iter().any(|p| p.rgba[3] > 0.0), "{} shows nothing", preset.name);
            assert!(t.points()[0].rgba[3] == 0.0 || preset.name == "CT-X-ray", "{} shows air", preset.name);
            assert!(!preset.about.is_empty(), "{} says what it is for", preset.name);
            assert_eq!(by_name(&preset.name.to_lowercase()), Some(preset), "found by its name, once");
            let relative = preset.points.iter().all(|p| (0.0..=1.0).contains(&p[0]));
            assert_eq!(relative, preset.relative, "{}: values against what they are", preset.name);
        }
    }

    #[test]
    fn a_relative_preset_spans_the_range() {
        let t = by_name("grey-ramp").expect("a preset").transfer([100.0, 300.0]).expect("transfer");
        assert_eq!(t.rgba(200.0)[0], 0.5, "half way");
        let flat = by_name("grey-ramp").expect("a preset").transfer([7.0, f64::NAN]);
        assert!(flat.is_ok(), "a range that is none counts as one unit");
    }

    #[test]
    fn the_default_goes_by_the_modality_then_by_air() {
        let of = |name: &str, range| by_name(name).expect("a preset").transfer(range).expect("transfer");
        let positive = [0.0, 900.0];
        assert_eq!(default_for(Some("ct"), positive), of(DEFAULT_CT, positive), "CT by its word");
        assert_eq!(default_for(None, [-1000.0, 900.0]), of(DEFAULT_CT, positive), "CT by its air");
        assert_eq!(default_for(None, positive), of(DEFAULT_MR, positive), "no air");
        assert_eq!(default_for(Some("MR"), [-900.0, 1.0]), of(DEFAULT_MR, [-900.0, 1.0]), "MR by its word");
        assert_eq!(plain([5.0, f64::NAN]).rgba(9.0)[0], 1.0, "what is left where all fails");
    }
}
