//! The panel of the volumes.

use egui::{Button, ComboBox, Slider, Ui};

use super::{mode, window};
use crate::case::{Edit, Volume, assets};
use crate::host::context::{Request, TextureFormat, ToolContext, Window};
use crate::host::views;
use crate::sections;
use crate::ui::notes::notes_ui;
use crate::ui::pose::{PoseEditor, PoseInput};
use crate::ui::{name, theme, value};

pub(super) fn show_ui(pose: &mut PoseEditor, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    ui.horizontal(|ui| {
        if ui.button("Open file…").on_hover_text("A case, a volume or a surface").clicked() {
            ctx.request(Request::OpenFile);
        }
        if ui.button("Open folder…").on_hover_text("A DICOM series").clicked() {
            ctx.request(Request::OpenFolder);
        }
        if ui.button("Fit views").clicked() {
            ctx.request(Request::Fit);
        }
    });
    if ctx.case.volumes.is_empty() {
        theme::quiet_ui(ui, "No volume yet. Open one, or drop a file or folder on the window.");
        return;
    }
    for volume in &ctx.case.volumes {
        row_ui(ctx, ui, volume);
    }
    if let Some(volume) = ctx.volume() {
        ui.separator();
        chosen_ui(pose, ctx, ui, volume);
    }
}

fn row_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume) {
    ui.horizontal(|ui| {
        let mut visible = volume.visible;
        let shown = ui.checkbox(&mut visible, "").on_hover_text("Show in all views");
        shown.widget_info(|| {
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, format!("Show {}", volume.id))
        });
        if shown.changed() {
            ctx.edit(Edit::SetVolumeVisible { id: volume.id.clone(), visible });
        }
        let chosen = ctx.selection.volume.as_deref() == Some(volume.id.as_str());
        if ui.selectable_label(chosen, &volume.id).clicked() {
            ctx.selection.volume = Some(volume.id.clone());
        }
        if ctx.assets.grid(volume).is_none() {
            theme::quiet_ui(ui, if volume.visible { "not loaded" } else { "loads when shown" });
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if ui.small_button("Remove").clicked() {
                ctx.edit(Edit::RemoveVolume { id: volume.id.clone() });
            }
        });
    });
}

fn chosen_ui(pose: &mut PoseEditor, ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume) {
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "volume", &volume.id) {
            ctx.edit(Edit::RenameVolume { id: volume.id.clone(), to });
        }
    });
    let key = assets::Key::of_volume(volume);
    if let (Some(asset), Some(grid)) = (ctx.assets.asset(&key), ctx.assets.grid(volume)) {
        let [nx, ny, nz] = grid.extent();
        let [sx, sy, sz] = grid.spacing_mm();
        let [low, high] = grid.range();
        let modality = asset.modality.as_deref().unwrap_or("no modality given");
        theme::quiet_ui(ui, format!("{} · {modality} · {} samples", asset.format, grid.samples().kind()));
        theme::quiet_ui(ui, format!("{nx} × {ny} × {nz} voxels of {sx:.3} × {sy:.3} × {sz:.3} mm"));
        theme::quiet_ui(ui, format!("values {low:.0} … {high:.0}"));
        notes_ui(ui, &asset.notes);
        window_ui(ctx, ui, volume, grid.range());
        let mut blend = volume.blend;
        if ui.add(Slider::new(&mut blend, 0.0..=1.0).text("Weight in the sections")).changed() {
            ctx.edit(Edit::SetBlend { id: volume.id.clone(), blend });
        }
        mode::mode_ui(ctx, ui, volume, &grid, sections::unit(ctx.assets, volume, &grid));
        texture_ui(ctx, ui, volume);
        let centre = views::ball_of(volume, &grid).centre;
        ui.collapsing("Place in the world", |ui| {
            // The middle in its own place is before the pose.
            let own = volume.pose.inverse().point(&centre);
            let crosshair = ctx.crosshair();
            let input = PoseInput { pose: volume.pose, centre: own, crosshair, offered: None };
            if let Some(pose) = pose.ui(ui, &input) {
                ctx.edit(Edit::SetVolumePose { id: volume.id.clone(), pose });
            }
        });
    }
}

fn window_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume, range: [f64; 2]) {
    theme::section_ui(ui, "Window in the sections");
    let is_ct = range[0] < -500.0;
    let Some(window) = ctx.views.windows.get_mut(&volume.id) else { return };
    let speed = (window.width / 300.0).max(1e-3);
    ui.horizontal(|ui| {
        value::number_ui(ui, "Level", &mut window.level, speed);
        value::number_ui(ui, "Width", &mut window.width, speed);
    });
    window.width = window.width.max(1e-3);
    ui.horizontal_wrapped(|ui| {
        let named = if is_ct { window::CT_WINDOWS.as_slice() } else { &[] };
        for choice in named {
            if ui.add(Button::new(choice.name).small()).clicked() {
                *window = choice.window;
            }
        }
        if ui.add(Button::new("All values").small()).clicked() {
            *window = window::whole(range);
        }
    });
    let Window { level, width } = *window;
    theme::quiet_ui(ui, format!("black at {:.0}, white at {:.0}", level - width / 2.0, level + width / 2.0));
}

fn texture_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume) {
    let name = |format| match format {
        TextureFormat::R16 => "R16: exact, 16 bits",
        TextureFormat::R32f => "R32F: exact, 32 bits",
        TextureFormat::Bc4 => "BC4: lossy, 4 bits",
        TextureFormat::Bc5 => "BC5: lossy, two planes of 4 bits",
        TextureFormat::Rgba8 => "RGBA8: colours, 32 bits",
        TextureFormat::Bc3 => "BC3: lossy colours, 8 bits",
        TextureFormat::Bc7 => "BC7: lossy colours, 8 bits",
        _ => "Automatic",
    };
    let mut format = volume.texture;
    ui.add_space(6.0);
    ComboBox::from_label("on the GPU").selected_text(name(format)).width(200.0).show_ui(ui, |ui| {
        for choice in [
            TextureFormat::Auto,
            TextureFormat::R16,
            TextureFormat::R32f,
            TextureFormat::Bc4,
            TextureFormat::Bc5,
            TextureFormat::Rgba8,
            TextureFormat::Bc3,
            TextureFormat::Bc7,
        ] {
            ui.selectable_value(&mut format, choice, name(choice));
        }
    });
    if format != volume.texture {
        ctx.edit(Edit::SetTexture { id: volume.id.clone(), texture: format });
    }
    if !matches!(format, TextureFormat::Auto | TextureFormat::R16 | TextureFormat::R32f) {
        theme::quiet_ui(ui, "The 3D picture shows lossy data; sections and values stay exact.");
    }
}
