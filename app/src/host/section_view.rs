//! One cross-section on the screen: its picture, what lies over it, and what the pointer does in it.
//!
//! Left button: crosshair, or on a dot of another section's line: turn that section; or what the chosen tool does.
//! Right drag: window (across) and level (along). Wheel: next slice. Ctrl with the wheel: zoom. Middle drag, or
//! shift with the left: pan. Double click: this view alone, and back.

use std::sync::Arc;

use egui::{
    Align2, Color32, ColorImage, FontId, Painter, PointerButton, Pos2, Rect, Sense, Stroke, TextureHandle,
    TextureOptions, Ui, pos2, vec2,
};
use render::scene::CellItem;
use render::section::{self, Layer, Section, SlabMode};
use render::volume::{Point, TriangleMesh, Vector};

use super::camera::{Ball, Facing};
use super::context::ToolContext;
use super::pointer::{Phase, SectionEvent};
use super::section_key::Key;
use super::turning::{DOT_REACH, crosshair_ui, turn, turning_dots};
use super::views::{Orientation, ViewId, Views};
use crate::case::{Assets, Case};
use crate::sections::{self, ShownGrid};
use crate::ui::{number, theme};

/// An implant's outline, kept while section and surface stay.
#[derive(Debug, Clone)]
struct Outline {
    mesh: Arc<TriangleMesh>,
    pose: render::volume::Affine,
    section: Section,
    lines: Vec<[Point; 2]>,
}

/// What the drag going on does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Drag {
    /// There is none, or the crosshair follows it.
    #[default]
    Crosshair,
    /// The tool has it.
    Tool,
    /// Another section turns.
    Turn(Orientation),
}

/// One section's texture and what it was made from.
#[derive(Default)]
pub struct SectionView {
    drag: Drag,
    texture: Option<TextureHandle>,
    key: Option<Key>,
    outlines: Vec<Outline>,
}

impl std::fmt::Debug for SectionView {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SectionView").field("key", &self.key).finish_non_exhaustive()
    }
}

/// What a section is drawn from.
#[derive(Debug)]
pub struct SectionInput<'a> {
    /// The plan.
    pub case: &'a Case,
    /// Its data.
    pub assets: &'a Assets,
    /// The visible volumes.
    pub layers: &'a [Layer],
    /// Names and units of the layers' volumes.
    pub names: &'a [(String, String)],
    /// The visible unstructured grids.
    pub grids: &'a [ShownGrid],
    /// The volume whose window a right drag changes.
    pub windowed: Option<&'a str>,
    /// The ball about everything.
    pub ball: Ball,
    /// Whether something is being dragged: then half the pixels each way will do.
    pub moving: bool,
    /// The radius of the tool's brush; mm.
    pub brush_mm: Option<f64>,
}

/// Gets the pointer before the section does, and says whether it takes the drag.
pub type PassOn<'a> = dyn FnMut(&mut ToolContext<'_>, &SectionEvent) -> bool + 'a;

impl SectionView {
    /// Draws the section in `rect`, changes the context's views as the pointer asks. `tool` gets the pointer first.
    pub fn ui(
        &mut self,
        ui: &mut Ui,
        rect: Rect,
        orientation: Orientation,
        input: &SectionInput<'_>,
        ctx: &mut ToolContext<'_>,
        tool: &mut PassOn<'_>,
    ) {
        let response = ui.interact(rect, ui.scope_id().with(orientation.title()), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, orientation.title()));
        let size = [f64::from(rect.width()), f64::from(rect.height())];
        let pixels_per_point = f64::from(ui.ctx().pixels_per_point());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, Color32::BLACK);
        if let Ok(section) = ctx.views.section(orientation, input.ball, size, 1.0) {
            let map = OnScreen { section, rect };
            if !self.drags(ui, &response, &map, orientation, ctx, tool) {
                act(ui, &response, rect, &section, orientation, input, ctx.views);
            }
        }
        let views = &*ctx.views;
        // Anew, since the pointer may just have moved it.
        let Ok(in_points) = views.section(orientation, input.ball, size, 1.0) else { return };
        let density = if input.moving { 0.5 * pixels_per_point } else { pixels_per_point };
        if let Ok(in_pixels) = views.section(orientation, input.ball, size, density) {
            self.picture(ui, &painter, rect, orientation, in_pixels, input);
        }
        let map = OnScreen { section: in_points, rect };
        self.outlines_ui(&painter, &map, input);
        cutters_ui(&painter, &map, input);
        if let Some(crosshair) = views.crosshair {
            crosshair_ui(&painter, &map, orientation, views, &crosshair, response.hover_pos());
        }
        if let (Some(radius_mm), Some(at)) = (input.brush_mm, response.hover_pos()) {
            let radius = (radius_mm / map.section.mm_per_pixel()) as f32;
            painter.circle_stroke(at, radius, Stroke::new(1.2, theme::HOT));
        }
        letters_ui(&painter, &map);
        legend_ui(&painter, rect, input);
        words_ui(&painter, &map, &response, orientation, input, views);
        painter.rect_stroke(
            rect,
            0.0,
            Stroke::new(1.0, orientation.color().gamma_multiply(0.55)),
            egui::StrokeKind::Inside,
        );
    }

    /// What a drag with the left button does before the crosshair gets it: turning another section by its dot, or
    /// what the tool makes of it. Whether it was that.
    fn drags(
        &mut self,
        ui: &Ui,
        response: &egui::Response,
        map: &OnScreen,
        orientation: Orientation,
        ctx: &mut ToolContext<'_>,
        tool: &mut PassOn<'_>,
    ) -> bool {
        let (origin, shift) = ui.input(|i| (i.pointer.press_origin(), i.modifiers.shift));
        let Some(at) = response.interact_pointer_pos() else { return false };
        let event = |phase, at: Pos2| SectionEvent { phase, place: map.point(at) };
        if response.drag_started_by(PointerButton::Primary) && !shift {
            let origin = origin.unwrap_or(at);
            let held = ctx.views.crosshair.and_then(|crosshair| {
                turning_dots(map, orientation, ctx.views, &crosshair)
                    .into_iter()
                    .find(|(_, dot)| dot.distance(origin) <= DOT_REACH)
            });
            self.drag = match held {
                Some((other, _)) => Drag::Turn(other),
                None if tool(ctx, &event(Phase::Press, origin)) => Drag::Tool,
                None => Drag::Crosshair,
            };
        } else if response.clicked() && tool(ctx, &event(Phase::Press, at)) {
            tool(ctx, &event(Phase::Release, at));
            return true;
        }
        let taken = self.drag != Drag::Crosshair;
        if response.dragged_by(PointerButton::Primary) {
            match self.drag {
                Drag::Tool => {
                    tool(ctx, &event(Phase::Drag, at));
                }
                Drag::Turn(other) => turn(map, other, ctx.views, at - response.drag_delta(), at),
                Drag::Crosshair => {}
            }
        }
        if response.drag_stopped() {
            if self.drag == Drag::Tool {
                tool(ctx, &event(Phase::Release, at));
            }
            self.drag = Drag::Crosshair;
        }
        taken
    }

    fn picture(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        rect: Rect,
        orientation: Orientation,
        section: Section,
        input: &SectionInput<'_>,
    ) {
        let SectionInput { layers, grids, .. } = input;
        if layers.is_empty() && grids.is_empty() {
            self.key = None;
            self.texture = None;
            return;
        }
        let key = Key::of(section, layers, grids);
        if self.key.as_ref() != Some(&key) {
            let items: Vec<CellItem> = grids.iter().map(|shown| shown.item.clone()).collect();
            let bytes = section::picture(&section, layers, &items, [0.0; 3]);
            let image = ColorImage::from_rgba_unmultiplied(section.size(), &bytes);
            if let Some(texture) = &mut self.texture {
                texture.set(image, TextureOptions::LINEAR);
            } else {
                let name = orientation.title();
                self.texture = Some(ui.ctx().load_texture(name, image, TextureOptions::LINEAR));
            }
            self.key = Some(key);
        }
        if let Some(texture) = &self.texture {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture.id(), rect, whole, Color32::WHITE);
        }
    }

    fn outlines_ui(&mut self, painter: &Painter, map: &OnScreen, input: &SectionInput<'_>) {
        let mut kept = Vec::new();
        for implant in input.case.implants.iter().filter(|i| i.visible) {
            let cut = crate::scene::implant_cut(input.case, implant, input.assets);
            let Some(mesh) = cut.and_then(|cut| cut.mesh) else { continue };
            let pose = crate::scene::world_from_model(implant);
            let known = self
                .outlines
                .iter()
                .position(|o| Arc::ptr_eq(&o.mesh, &mesh) && o.pose == pose && o.section == map.section);
            let outline = match known {
                Some(at) => self.outlines.swap_remove(at),
                None => Outline {
                    pose,
                    section: map.section,
                    lines: section::mesh_outline(&map.section, &mesh, &pose),
                    mesh,
                },
            };
            let [r, g, b] = implant.color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
            let stroke = Stroke::new(1.5, Color32::from_rgb(r, g, b));
            painter.extend(
                outline
                    .lines
                    .iter()
                    .map(|[a, b]| egui::Shape::line_segment([map.place(a), map.place(b)], stroke)),
            );
            kept.push(outline);
        }
        self.outlines = kept;
    }
}

/// A section with its place on the screen; one of its pixels is one point.
pub(super) struct OnScreen {
    pub(super) section: Section,
    pub(super) rect: Rect,
}

impl OnScreen {
    pub(super) fn place(&self, p: &Point) -> Pos2 {
        let [x, y] = self.section.pixel(p);
        // Its size was rounded to whole pixels.
        let [width, height] = self.section.size();
        let x = x / width as f64 * f64::from(self.rect.width());
        let y = y / height as f64 * f64::from(self.rect.height());
        pos2(self.rect.left() + x as f32, self.rect.top() + y as f32)
    }

    pub(super) fn point(&self, at: Pos2) -> Point {
        let [width, height] = self.section.size();
        let x = f64::from((at.x - self.rect.left()) / self.rect.width()) * width as f64;
        let y = f64::from((at.y - self.rect.top()) / self.rect.height()) * height as f64;
        self.section.point(x, y)
    }
}

/// Pointer and wheel.
fn act(
    ui: &Ui,
    response: &egui::Response,
    rect: Rect,
    section: &Section,
    orientation: Orientation,
    input: &SectionInput<'_>,
    views: &mut Views,
) {
    let map = OnScreen { section: *section, rect };
    let shift = ui.input(|i| i.modifiers.shift);
    let delta = response.drag_delta();
    if response.double_clicked() {
        let this = ViewId::Section(orientation);
        views.only = if views.only == Some(this) { None } else { Some(this) };
        return;
    }
    let pans =
        response.dragged_by(PointerButton::Middle) || (shift && response.dragged_by(PointerButton::Primary));
    if pans {
        let mm = section.mm_per_pixel();
        let by = section.right() * (f64::from(delta.x) * mm) + section.down() * (f64::from(delta.y) * mm);
        let state = &mut views.sections[orientation.index()];
        state.centre = Some(state.centre.unwrap_or(input.ball.centre) - by);
    } else if let Some(at) = response.interact_pointer_pos()
        && (response.clicked() || response.dragged_by(PointerButton::Primary))
    {
        views.crosshair = Some(map.point(at));
    } else if response.dragged_by(PointerButton::Secondary)
        && let Some(window) = input.windowed.and_then(|id| views.windows.get_mut(id))
    {
        *window = windowed(*window, [f64::from(delta.x), f64::from(delta.y)]);
    }
    if !response.hovered() {
        return;
    }
    // Ctrl with the wheel, and a pinch, come as a zoom.
    let (wheel, zoom) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
    if zoom != 1.0 {
        let state = &mut views.sections[orientation.index()];
        state.mm_per_point = Some((section.mm_per_pixel() / f64::from(zoom)).clamp(0.005, 20.0));
    } else if wheel != 0.0 {
        // Half a voxel a notch's quarter: slices pass one by one, and a swipe goes far.
        let normal = views.normal(orientation);
        let step_mm = match input.layers {
            // A grid has no slices, and may be of any size.
            [] if !input.grids.is_empty() => input.ball.radius_mm / 100.0,
            layers => slice_step_mm(layers, &normal),
        };
        let crosshair = views.crosshair.unwrap_or(input.ball.centre);
        views.crosshair = Some(crosshair + normal * (f64::from(wheel) / WHEEL_POINTS * step_mm));
    }
}

/// Points of scrolling that make one slice: a notch of a usual wheel.
const WHEEL_POINTS: f64 = 40.0;

/// The distance between slices across a section: the finest spacing of the first volume along it.
fn slice_step_mm(layers: &[Layer], normal: &Vector) -> f64 {
    let step = |layer: &Layer| {
        let linear = (layer.pose * *layer.grid.world_from_voxel()).linear();
        let columns = [0, 1, 2].map(|c| linear.column(c).into_owned());
        // The axis of the grid that runs most nearly across.
        let best = columns.iter().max_by(|a, b| {
            let part = |v: &Vector| v.dot(normal).abs() / v.norm();
            part(a).total_cmp(&part(b))
        });
        best.map_or(1.0, |v| v.norm())
    };
    layers.first().map_or(1.0, step)
}

/// A window after a drag in points: across widens, upwards raises the level.
fn windowed(window: section::Window, drag: [f64; 2]) -> section::Window {
    let width = (window.width * (drag[0] * 0.006).exp()).clamp(1e-3, 1e7);
    section::Window { level: window.level - drag[1] * window.width * 0.003, width }
}

fn cutters_ui(painter: &Painter, map: &OnScreen, input: &SectionInput<'_>) {
    let reach_mm = 4.0 * input.ball.radius_mm;
    for line in sections::cutter_lines(input.case, input.layers, &map.section, reach_mm) {
        let line: Vec<Pos2> = line.iter().map(|p| map.place(p)).collect();
        painter.add(egui::Shape::line(line, Stroke::new(1.2, theme::CUTTER)));
    }
}

/// The labels of the shown volumes, each with its colour, down the left side.
fn legend_ui(painter: &Painter, rect: Rect, input: &SectionInput<'_>) {
    const MOST: usize = 10;
    let font = FontId::proportional(11.5);
    let shown = input.case.volumes.iter().filter(|v| v.visible);
    let sets = shown.filter_map(|v| input.case.labels_of(&v.id));
    let rows = sets.flat_map(|set| {
        let counts = input.assets.labels(input.case, set).map(|l| l.counts).unwrap_or_default();
        let labels: Vec<u32> = counts.keys().copied().filter(|&n| set.color(n)[3] > 0.0).collect();
        labels.into_iter().map(move |n| (set.color(n), format!("{} {n}", set.id)))
    });
    for (row, ([r, g, b, _], words)) in rows.take(MOST).enumerate() {
        let at = rect.left_top() + vec2(8.0, 28.0 + 15.0 * row as f32);
        let [r, g, b] = [r, g, b].map(|c| (c * 255.0).round() as u8);
        painter.rect_filled(Rect::from_min_size(at, vec2(10.0, 10.0)), 1.0, Color32::from_rgb(r, g, b));
        shadowed_ui(painter, at + vec2(15.0, -2.0), Align2::LEFT_TOP, &words, &font, theme::QUIET);
    }
}

fn letters_ui(painter: &Painter, map: &OnScreen) {
    let section = &map.section;
    edge_letters_ui(painter, map.rect, &section.right(), &-section.down());
}

/// The body's sides at the middle of each edge of a view.
pub(super) fn edge_letters_ui(painter: &Painter, rect: Rect, right: &Vector, up: &Vector) {
    let font = FontId::proportional(17.0);
    let color = Color32::from_rgb(250, 222, 120);
    let margin = 7.0;
    let places = [
        (Facing::letters(right), rect.right_center() - vec2(margin, 0.0), Align2::RIGHT_CENTER),
        (Facing::letters(&-right), rect.left_center() + vec2(margin, 0.0), Align2::LEFT_CENTER),
        (Facing::letters(up), rect.center_top() + vec2(0.0, margin), Align2::CENTER_TOP),
        (Facing::letters(&-up), rect.center_bottom() - vec2(0.0, margin), Align2::CENTER_BOTTOM),
    ];
    for (letters, at, align) in places {
        shadowed_ui(painter, at, align, &letters, &font, color);
    }
}

/// Words over a picture, with a dark edge so that they are read on white too.
pub(super) fn shadowed_ui(
    painter: &Painter,
    at: Pos2,
    align: Align2,
    text: &str,
    font: &FontId,
    color: Color32,
) {
    for offset in [vec2(1.0, 1.0), vec2(-1.0, 0.0), vec2(0.0, -1.0)] {
        painter.text(at + offset, align, text, font.clone(), Color32::from_black_alpha(200));
    }
    painter.text(at, align, text, font.clone(), color);
}

fn words_ui(
    painter: &Painter,
    map: &OnScreen,
    response: &egui::Response,
    orientation: Orientation,
    input: &SectionInput<'_>,
    views: &Views,
) {
    let font = FontId::proportional(12.5);
    let rect = map.rect;
    let mut title = title(orientation, views);
    if !input.grids.is_empty() && views.sections[orientation.index()].slab.thickness_mm > 0.0 {
        title.push_str(" (grids: middle plane)");
    }
    shadowed_ui(
        painter,
        rect.left_top() + vec2(8.0, 6.0),
        Align2::LEFT_TOP,
        &title,
        &font,
        orientation.color(),
    );
    let window = input.windowed.and_then(|id| views.windows.get(id));
    if let Some(window) = window {
        let words = format!("W {:.0}  L {:.0}", window.width, window.level);
        shadowed_ui(
            painter,
            rect.right_top() + vec2(-8.0, 6.0),
            Align2::RIGHT_TOP,
            &words,
            &font,
            theme::QUIET,
        );
    }
    scale_bar_ui(painter, map, &font);
    if let Some(at) = response.hover_pos() {
        let p = map.point(at);
        let named = input.layers.iter().zip(input.names);
        let values = named.filter_map(|(layer, (name, unit))| {
            let label = match layer.label(&p) {
                0 => String::new(),
                label => format!(" (label {label})"),
            };
            layer.value(&p).map(|value| format!("{name} {value:.0}{unit}{label}"))
        });
        let cells = input.grids.iter().filter_map(|shown| {
            Some(format!("{} {}", shown.title, number::with_unit(shown.value(&p)?, &shown.unit)))
        });
        let words = std::iter::once(lps(&p)).chain(values).chain(cells).collect::<Vec<_>>().join("   ");
        let white = Color32::from_rgb(235, 238, 241);
        shadowed_ui(painter, rect.left_bottom() + vec2(8.0, -7.0), Align2::LEFT_BOTTOM, &words, &font, white);
    }
}

/// What a section is, where, and how thick: `"Axial  S 12.0 mm"`, `"Axial, turned 20.0°  MIP of 10.0 mm"`.
fn title(orientation: Orientation, views: &Views) -> String {
    let state = &views.sections[orientation.index()];
    let (axis, turned_deg) = (orientation.normal_axis(), state.turn.angle().to_degrees());
    let place = match views.crosshair {
        _ if turned_deg > 0.005 => format!(", turned {turned_deg:.1}°"),
        Some(crosshair) => format!("  {}", lps_part(axis, crosshair[axis])),
        None => String::new(),
    };
    let slab = match state.slab.mode {
        _ if state.slab.thickness_mm == 0.0 => String::new(),
        SlabMode::Mean => format!("  mean of {:.1} mm", state.slab.thickness_mm),
        SlabMode::Mip => format!("  MIP of {:.1} mm", state.slab.thickness_mm),
        SlabMode::MinIp => format!("  MinIP of {:.1} mm", state.slab.thickness_mm),
    };
    format!("{}{place}{slab}", orientation.title())
}

/// A bar of a round length, a quarter of the view at most.
fn scale_bar_ui(painter: &Painter, map: &OnScreen, font: &FontId) {
    let mm_per_point = map.section.mm_per_pixel();
    let most_mm = f64::from(map.rect.width()) * 0.25 * mm_per_point;
    let lengths = [0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];
    let Some(length_mm) = lengths.into_iter().rev().find(|l| *l <= most_mm) else { return };
    let right = map.rect.right_bottom() + vec2(-10.0, -12.0);
    let left = right - vec2((length_mm / mm_per_point) as f32, 0.0);
    painter.line_segment([left, right], Stroke::new(2.0, Color32::WHITE));
    let words = format!("{length_mm} mm");
    shadowed_ui(painter, right - vec2(0.0, 4.0), Align2::RIGHT_BOTTOM, &words, font, Color32::WHITE);
}

/// A coordinate as people say it: `"L 12.3 mm"`, `"R 4.0 mm"`.
pub(super) fn lps_part(axis: usize, value: f64) -> String {
    let letters = [["L", "R"], ["P", "A"], ["S", "I"]][axis.min(2)];
    let letter = if value < 0.0 { letters[1] } else { letters[0] };
    format!("{letter} {:.1} mm", value.abs())
}

/// A place: `"L 12.3  P 4.0  I 88.1 mm"`.
pub(super) fn lps(p: &Point) -> String {
    let part = |axis: usize| lps_part(axis, p[axis]).trim_end_matches(" mm").to_owned();
    format!("{}  {}  {} mm", part(0), part(1), part(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::scene::Piece;
    use render::volume::{Affine, Grid, Rescale, Samples};

    #[test]
    fn a_place_is_said_by_the_side_it_lies_on() {
        assert_eq!(lps(&Point::new(-12.34, 4.0, -88.0)), "R 12.3  P 4.0  I 88.0 mm", "sides, not signs");
        assert_eq!(lps_part(2, 7.25), "S 7.2 mm", "one coordinate");
    }

    #[test]
    fn the_screen_and_the_section_agree() {
        let rect = Rect::from_min_size(pos2(100.0, 50.0), vec2(400.5, 299.5));
        let section = Section::new(Point::new(5.0, 6.0, 7.0), Vector::x(), -Vector::z(), 0.5, [401, 300]);
        let map = OnScreen { section: section.expect("section"), rect };
        let at = pos2(222.0, 333.0);
        assert!(map.place(&map.point(at)).distance(at) < 1e-3, "there and back");
        assert!((map.point(rect.center()) - Point::new(5.0, 6.0, 7.0)).norm() < 1e-4, "middle to middle");
    }

    #[test]
    fn the_wheel_steps_by_the_slices_of_the_grid_however_it_lies() {
        // Slices 3 mm apart along the grid's z, which points to the front here.
        let columns = Affine::from_columns(
            Vector::new(0.5, 0.0, 0.0),
            Vector::new(0.0, 0.0, 0.5),
            Vector::new(0.0, -3.0, 0.0),
            Point::origin(),
        );
        let grid =
            Grid::new([2, 2, 2], Samples::U8(vec![0; 8]), Rescale::default(), columns.expect("columns"));
        let layer = Layer {
            grid: Arc::new(grid.expect("grid")),
            pose: Affine::identity(),
            pieces: vec![Piece::whole()],
            window: section::Window { level: 0.0, width: 1.0 },
            color: [1.0; 3],
            weight: 1.0,
            labels: None,
        };
        let step = |normal| slice_step_mm(std::slice::from_ref(&layer), &normal);
        assert_eq!((step(Vector::y()), step(Vector::z())), (3.0, 0.5), "by direction");
        assert_eq!(slice_step_mm(&[], &Vector::z()), 1.0, "a millimetre where there is nothing");
    }

    #[test]
    fn a_dot_turns_the_other_section_so_that_its_line_follows_the_pointer() {
        let rect = Rect::from_min_size(pos2(0.0, 0.0), vec2(400.0, 300.0));
        let mut views = Views { crosshair: Some(Point::new(1.0, 2.0, 3.0)), ..Views::new() };
        let ball = Ball { centre: Point::new(1.0, 2.0, 3.0), radius_mm: 50.0 };
        let section = views.section(Orientation::Axial, ball, [400.0, 300.0], 1.0).expect("section");
        let map = OnScreen { section, rect };
        let dots = turning_dots(&map, Orientation::Axial, &views, &Point::new(1.0, 2.0, 3.0));
        assert_eq!(dots.len(), 4, "two on each line");
        let (other, dot) = dots[0];
        let middle = rect.center();
        let to = middle + egui::emath::Rot2::from_angle(0.4) * (dot - middle);
        turn(&map, other, &mut views, dot, to);
        let after = turning_dots(&map, Orientation::Axial, &views, &Point::new(1.0, 2.0, 3.0));
        assert!(after.iter().any(|(o, at)| *o == other && at.distance(to) < 1e-2), "it is under the pointer");
        let turned = views.sections[other.index()].turn.angle();
        assert!((turned - 0.4).abs() < 1e-4, "by as much: {turned}");
        let words = title(other, &views);
        assert!(words.contains("turned 22.9°"), "and it says so: {words}");
    }

    #[test]
    fn a_window_drag_widens_across_and_raises_upwards() {
        let before = section::Window { level: 100.0, width: 400.0 };
        let after = windowed(before, [50.0, -20.0]);
        assert!(after.width > before.width && after.level > before.level, "{after:?}");
        assert!(windowed(before, [-1e6, 0.0]).width > 0.0, "never closed");
    }
}
