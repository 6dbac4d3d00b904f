//! What is drawn of a volume in 3D: the choice, and the first value of an isosurface.

use egui::{ComboBox, Slider, SliderClamping, Ui};
use render::volume::{Grid, Transfer};

use crate::case::{Edit, Volume};
use crate::host::context::{ToolContext, VolumeMode};
use crate::ui::theme;

pub(super) fn mode_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume, grid: &Grid, unit: &str) {
    theme::section_ui(ui, "In 3D");
    let mut mode = volume.mode;
    let surface = match mode {
        VolumeMode::Isosurface { .. } => mode,
        _ => VolumeMode::Isosurface { value: first_level(&volume.transfer, grid.range()), opacity: 1.0 },
    };
    let words = |mode| match mode {
        VolumeMode::Composite => "Composite",
        VolumeMode::Mip => "Greatest value (MIP)",
        VolumeMode::Isosurface { .. } => "Isosurface",
    };
    ComboBox::from_label("Drawn as").selected_text(words(mode)).width(200.0).show_ui(ui, |ui| {
        for choice in [VolumeMode::Composite, VolumeMode::Mip, surface] {
            ui.selectable_value(&mut mode, choice, words(choice));
        }
    });
    if let VolumeMode::Isosurface { value, opacity } = &mut mode {
        let [low, high] = grid.range();
        // A value of the file outside the range stays until it is touched.
        let slider = Slider::new(value, low..=high).clamping(SliderClamping::Edits).max_decimals(2);
        ui.add(slider.suffix(unit).text("Value"));
        ui.add(Slider::new(opacity, 0.0..=1.0).max_decimals(2).text("Opacity of the surface"));
    }
    match mode {
        VolumeMode::Composite => {}
        VolumeMode::Mip => {
            theme::quiet_ui(ui, "Drawn by the processor, in the transfer function's colour and opacity.");
        }
        VolumeMode::Isosurface { .. } => {
            theme::quiet_ui(ui, "Drawn by the processor, in the transfer function's colour of that value.");
        }
    }
    if mode != volume.mode {
        ctx.edit(Edit::SetVolumeMode { id: volume.id.clone(), mode });
    }
}

/// Where an isosurface begins: the least value that is half as opaque as the most opaque, within `range`. What a
/// transfer function shows begins there.
fn first_level(transfer: &Transfer, range: [f64; 2]) -> f64 {
    let points = transfer.points();
    let half = points.iter().map(|p| p.rgba[3]).fold(0.0, f64::max) / 2.0;
    let first = points.first().map_or(range[0], |p| p.value);
    let rise = points.windows(2).find(|pair| pair[0].rgba[3] < half && pair[1].rgba[3] >= half);
    let level = rise.map_or(first, |pair| {
        let part = (half - pair[0].rgba[3]) / (pair[1].rgba[3] - pair[0].rgba[3]);
        pair[0].value + (pair[1].value - pair[0].value) * part
    });
    level.max(range[0]).min(range[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::ControlPoint;

    fn level(points: &[(f64, f64)], range: [f64; 2]) -> f64 {
        let point = |&(value, a): &(f64, f64)| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        first_level(&Transfer::new(points.iter().map(point).collect(), 1.0).expect("transfer"), range)
    }

    #[test]
    fn an_isosurface_begins_where_the_transfer_function_rises() {
        let range = [-1000.0, 3000.0];
        assert_eq!(level(&[(100.0, 0.0), (300.0, 0.5), (900.0, 0.4)], range), 200.0, "half of 0.5");
        assert_eq!(level(&[(100.0, 0.0), (100.0, 0.5)], range), 100.0, "a jump");
        assert_eq!(level(&[(50.0, 0.0), (70.0, 0.0)], range), 50.0, "nothing is shown");
        assert_eq!(level(&[(50.0, 0.8), (70.0, 0.9)], range), 50.0, "opaque from the first point on");
        assert_eq!(level(&[(4000.0, 0.0), (5000.0, 1.0)], range), 3000.0, "within the volume's values");
    }
}
