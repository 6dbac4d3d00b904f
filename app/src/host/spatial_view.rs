//! The 3D view on the screen: the rendered picture, handles, letters and cube over it, and the camera.
//!
//! Left drag: orbit, or a tool's handle where one is under the pointer. Middle drag, or shift with the
//! left: pan. Wheel, or right drag: zoom. Double click: crosshair to what is seen there. A, P, L, R, S,
//! I: look from that side. Escape: what is being dragged goes back.

use egui::{
    Align2, Color32, FontId, Key, Painter, PointerButton, Pos2, Rect, Response, Sense, Stroke, Ui, pos2, vec2,
};
use render::scene::Camera;

use super::camera::{Ball, Facing, Lens};
use super::color_bar::bars_ui;
use super::cube;
use super::overlay::Overlay;
use super::pointer::{Phase, PointerEvent};
use super::section_view::{edge_letters_ui, shadowed_ui};
use crate::sections::ShownGrid;
use crate::ui::theme;

/// What the drag going on does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Drag {
    /// There is none, or it was cancelled.
    #[default]
    None,
    /// A tool has it.
    Tool,
    /// The camera turns.
    Orbit,
}

/// What the view needs in order to be drawn.
#[derive(Debug)]
pub struct SpatialInput<'a> {
    /// The camera as it is.
    pub camera: Camera,
    /// The ball about everything.
    pub ball: Ball,
    /// The picture, once there is one.
    pub texture: Option<egui::TextureId>,
    /// Words in the middle where there is no picture.
    pub instead: &'a str,
    /// Display colour behind everything.
    pub background: [f64; 3],
    /// What the tools draw.
    pub overlay: &'a Overlay,
    /// The visible unstructured grids, for their colour bars.
    pub grids: &'a [ShownGrid],
}

/// What the pointer and keys asked for.
#[derive(Debug, Clone, Copy, Default)]
pub struct SpatialAnswer {
    /// Another camera.
    pub camera: Option<Camera>,
    /// A double click: put the crosshair on what is seen there.
    pub pick: Option<PointerEvent>,
    /// The button that makes this view fill the window, and back.
    pub toggled: bool,
}

/// The view's own state.
#[derive(Debug, Clone, Default)]
pub struct SpatialView {
    drag: Drag,
}

impl SpatialView {
    /// Draws the view in `rect`. `tool` gets the pointer first and says whether it takes the drag.
    pub fn ui(
        &mut self,
        ui: &mut Ui,
        rect: Rect,
        input: &SpatialInput<'_>,
        tool: &mut dyn FnMut(&PointerEvent) -> bool,
    ) -> SpatialAnswer {
        let mut answer = SpatialAnswer::default();
        let response = ui.interact(rect, ui.scope_id().with("spatial"), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "3D view"));
        let painter = ui.painter_at(rect);
        let [r, g, b] = input.background.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
        painter.rect_filled(rect, 0.0, Color32::from_rgb(r, g, b));
        if let Some(texture) = input.texture {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture, rect, whole, Color32::WHITE);
        }
        if !input.instead.is_empty() {
            painter.text(
                rect.center(),
                Align2::CENTER_CENTER,
                input.instead,
                FontId::proportional(14.0),
                theme::QUIET,
            );
        }
        let size = [f64::from(rect.width()), f64::from(rect.height())];
        let Ok(lens) = Lens::new(&input.camera, size) else { return answer };
        input.overlay.paint(&painter, rect, &lens);
        bars_ui(&painter, rect, input.grids);
        edge_letters_ui(&painter, rect, &lens.frame().right, &lens.frame().up);
        let title = vec2(8.0, 6.0);
        let font = FontId::proportional(12.5);
        shadowed_ui(&painter, rect.left_top() + title, Align2::LEFT_TOP, "3D", &font, theme::ACCENT);
        let on_cube = cube_ui(&painter, rect, &lens, response.hover_pos());
        if let Some(side) = buttons_ui(ui, rect, &mut answer) {
            answer.camera = Some(side.camera(input.ball));
        }
        if response.clicked()
            && let Some(side) = on_cube
        {
            answer.camera = Some(side.camera(input.ball));
            return answer;
        }
        if let Some(side) = key_side(ui) {
            answer.camera = Some(side.camera(input.ball));
        }
        self.act(ui, &response, rect, lens, tool, &mut answer);
        answer
    }

    fn act(
        &mut self,
        ui: &Ui,
        response: &Response,
        rect: Rect,
        lens: Lens,
        tool: &mut dyn FnMut(&PointerEvent) -> bool,
        answer: &mut SpatialAnswer,
    ) {
        let at = |p: Pos2| [f64::from(p.x - rect.left()), f64::from(p.y - rect.top())];
        let event = |phase, p: Pos2| PointerEvent { phase, at: at(p), lens };
        let (shift, origin, escape) =
            ui.input(|i| (i.modifiers.shift, i.pointer.press_origin(), i.key_pressed(Key::Escape)));
        let delta = response.drag_delta();
        let drag = [f64::from(delta.x), f64::from(delta.y)];
        let pointer = response.interact_pointer_pos();
        if response.double_clicked()
            && let Some(p) = pointer
        {
            answer.pick = Some(event(Phase::Press, p));
        }
        if response.drag_started_by(PointerButton::Primary) && !shift {
            let taken = origin.is_some_and(|p| tool(&event(Phase::Press, p)));
            self.drag = if taken { Drag::Tool } else { Drag::Orbit };
        }
        if escape && self.drag != Drag::None {
            if self.drag == Drag::Tool
                && let Some(p) = pointer
            {
                tool(&event(Phase::Cancel, p));
            }
            self.drag = Drag::None;
        }
        if response.dragged_by(PointerButton::Middle)
            || (shift && response.dragged_by(PointerButton::Primary))
        {
            answer.camera = Some(lens.panned(drag));
        } else if response.dragged_by(PointerButton::Primary) {
            match (self.drag, pointer) {
                (Drag::Tool, Some(p)) => {
                    tool(&event(Phase::Drag, p));
                }
                (Drag::Orbit, _) if drag != [0.0, 0.0] => answer.camera = Some(lens.orbited(drag)),
                _ => {}
            }
        } else if response.dragged_by(PointerButton::Secondary) && drag[1] != 0.0 {
            answer.camera = Some(lens.zoomed((-drag[1] * 0.008).exp()));
        }
        if response.drag_stopped() {
            if self.drag == Drag::Tool
                && let Some(p) = pointer
            {
                tool(&event(Phase::Release, p));
            }
            self.drag = Drag::None;
        } else if let Some(p) = response.hover_pos()
            && self.drag == Drag::None
        {
            tool(&event(Phase::Hover, p));
        }
        if response.hovered() {
            let (wheel, zoom) =
                ui.input(|i| (f64::from(i.smooth_scroll_delta().y), f64::from(i.zoom_delta())));
            let factor = zoom * (wheel * 0.004).exp();
            if factor != 1.0 {
                answer.camera = Some(lens.zoomed(factor));
            }
        }
    }
}

/// The side whose key was pressed, where no text is being typed.
fn key_side(ui: &Ui) -> Option<Facing> {
    if ui.ctx().egui_wants_keyboard_input() {
        return None;
    }
    let keys = [Key::A, Key::P, Key::L, Key::R, Key::S, Key::I];
    let pressed = |key: Key| ui.input(|i| i.modifiers.is_none() && i.key_pressed(key));
    Facing::ALL.into_iter().zip(keys).find(|(_, key)| pressed(*key)).map(|(side, _)| side)
}

/// The six sides as buttons, and the one that makes the view fill the window.
fn buttons_ui(ui: &mut Ui, rect: Rect, answer: &mut SpatialAnswer) -> Option<Facing> {
    let bar = Rect::from_min_max(rect.right_top() + vec2(-190.0, 4.0), rect.right_top() + vec2(-4.0, 26.0));
    let mut chosen = None;
    let mut inner = ui.new_child(
        egui::UiBuilder::new().max_rect(bar).layout(egui::Layout::right_to_left(egui::Align::Center)),
    );
    inner.spacing_mut().item_spacing.x = 2.0;
    if inner.small_button("1/4").on_hover_text("This view alone, and back").clicked() {
        answer.toggled = true;
    }
    for side in Facing::ALL.into_iter().rev() {
        let button = inner.small_button(side.letter().to_string());
        if button.on_hover_text(format!("Look from {} (key {})", side.word(), side.letter())).clicked() {
            chosen = Some(side);
        }
    }
    chosen
}

/// Draws the cube; the side under the pointer.
fn cube_ui(painter: &Painter, rect: Rect, lens: &Lens, pointer: Option<Pos2>) -> Option<Facing> {
    const HALF: f32 = 19.0;
    let centre = rect.left_bottom() + vec2(46.0, -46.0);
    let hot = pointer.and_then(|p| {
        let at = [f64::from((p.x - centre.x) / HALF), f64::from((p.y - centre.y) / HALF)];
        cube::face_at(lens.frame(), at)
    });
    for face in cube::faces(lens.frame()) {
        let corners: Vec<Pos2> =
            face.corners.iter().map(|c| centre + vec2(c[0] as f32, c[1] as f32) * HALF).collect();
        let bright = (70.0 + 90.0 * face.facing) as u8;
        let fill = if hot == Some(face.side) {
            theme::ACCENT
        } else {
            Color32::from_rgba_unmultiplied(bright, bright, bright + 12, 215)
        };
        let middle = corners.iter().fold(egui::Vec2::ZERO, |sum, p| sum + p.to_vec2()) / 4.0;
        painter.add(egui::Shape::convex_polygon(corners, fill, Stroke::new(1.0, Color32::from_gray(20))));
        if face.facing > 0.25 {
            let font = FontId::proportional(9.0 + 8.0 * face.facing as f32);
            let letter = face.side.letter().to_string();
            painter.text(middle.to_pos2(), Align2::CENTER_CENTER, letter, font, Color32::WHITE);
        }
    }
    hot
}
