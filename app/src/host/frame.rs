//! One frame of the window: input, tools, edits, scene, picture.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use egui::layers::GraphicLayers;
use egui::{
    Button, CentralPanel, Frame, Key, KeyboardShortcut, Modifiers, Panel, Rect, RichText, ScrollArea, Ui,
};
use render::gpu::GpuError;
use render::scene::Scene;
use render::section::Layer;

use super::camera::Ball;
use super::context::{Request, Selection, ToolContext};
use super::dialogs::{Dialog, Question};
use super::overlay::Overlay;
use super::picture::{Picture, PictureKey};
use super::pointer::{PointerEvent, SectionEvent};
use super::registry::Registry;
use super::screenshot::{Screenshot, ScreenshotError};
use super::section_view::{SectionInput, SectionView};
use super::session::{Session, Wake};
use super::spatial_view::{SpatialAnswer, SpatialInput, SpatialView};
use super::status::status_ui;
use super::tool::ToolId;
use super::viewport::Viewport;
use super::views::{Orientation, ViewId, Views};
use super::{help, layout, loss, pick};
use crate::case::grids::GridChange;
use crate::case::{Case, Edit, assets};
use crate::scene;
use crate::sections::{self, ShownGrid};
use crate::ui::theme;

const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
const REDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
const OPEN: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::O);
const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
const SAVE_AS: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::S);

/// What the user is asked before changes are lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Leaving {
    No,
    /// The window is to close.
    Asked,
    /// Save first: the file dialog is open.
    Saving,
    /// It may close.
    Allowed,
}

/// The window's state.
pub struct Host {
    session: Session,
    registry: Registry,
    active: Option<ToolId>,
    selection: Selection,
    views: Views,
    spatial: SpatialView,
    sections: [SectionView; 3],
    picture: Picture,
    dialog: Option<Dialog>,
    help_open: bool,
    leaving: Leaving,
    replaced: u64,
    lost: bool,
    /// Frames until the device is given up.
    lose_before: Option<u64>,
    screenshot: Option<Screenshot>,
    screenshot_fault: Arc<Mutex<Option<ScreenshotError>>>,
    wake: Wake,
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host")
            .field("session", &self.session)
            .field("active", &self.active)
            .finish_non_exhaustive()
    }
}

/// What one frame asked for, to be done after it.
#[derive(Debug, Default)]
struct Wishes {
    edits: Vec<Edit>,
    requests: Vec<Request>,
    undo: bool,
    redo: bool,
    save: Option<bool>,
}

impl Host {
    /// A window on `case`, without a device: it shows panels and sections, but no 3D picture.
    pub fn new(case: Case, registry: Registry, wake: Wake) -> Self {
        let active = registry.titles().next().map(|(id, _)| id);
        Self {
            session: Session::new(case, Arc::clone(&wake)),
            registry,
            active,
            selection: Selection::default(),
            views: Views::new(),
            spatial: SpatialView::default(),
            sections: Default::default(),
            picture: Picture::default(),
            dialog: None,
            help_open: false,
            leaving: Leaving::No,
            replaced: 0,
            lost: false,
            lose_before: None,
            screenshot: None,
            screenshot_fault: Arc::default(),
            wake,
        }
    }

    /// Opens files and folders in the background.
    pub fn open(&mut self, paths: impl IntoIterator<Item = PathBuf>) {
        self.session.open(paths);
    }

    /// Gives it the device of a window that opens, or why there is none.
    pub fn attach(&mut self, viewport: Result<Viewport, GpuError>) {
        if self.lost {
            self.lost = false;
            self.session.complain(
                "The graphics device stopped answering. The window was opened again; nothing is lost.",
            );
        }
        if let Err(error) = &viewport {
            self.session.complain(error.to_string());
        }
        self.picture = Picture::new(viewport);
    }

    /// Takes a screenshot once everything is at rest, and closes; a failure goes to `fault`.
    pub fn screenshot(&mut self, screenshot: Option<Screenshot>, fault: Arc<Mutex<Option<ScreenshotError>>>) {
        self.screenshot = screenshot;
        self.screenshot_fault = fault;
    }

    /// Gives the device up before that frame, counted from 1.
    pub fn lose_before(&mut self, frame: Option<u64>) {
        self.lose_before = frame;
    }

    /// Whether the window closed because its device is lost.
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    /// The open case.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The open case, to be saved.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What the views show.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// Changes the case, as a tool does.
    #[cfg(test)]
    pub(super) fn apply(&mut self, edit: Edit) {
        self.session.edit(edit, 0.0);
    }

    /// One frame.
    pub fn frame_ui(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        if let Some(viewport) = self.picture.viewport().filter(|_| self.lose_before == Some(1)) {
            viewport.lose();
        }
        self.lose_before = self.lose_before.and_then(|frames| frames.checked_sub(1));
        if self.closes_if_lost(&ctx) {
            return;
        }
        let now_secs = ctx.input(|i| i.time);
        let mut wishes = Wishes::default();
        self.session.tick(now_secs);
        self.session.complain_of_steps();
        self.session.complain_of_grids();
        if self.session.replaced() != self.replaced {
            self.replaced = self.session.replaced();
            self.views = Views::new();
            self.selection = Selection::default();
        }
        self.selection.repair(self.session.case());
        self.views.adopt(self.session.case(), self.session.assets());
        self.dropped(&ctx);
        keys(&ctx, &mut wishes);

        Panel::top("bar").show(ui, |ui| self.bar_ui(ui, &mut wishes));
        self.problems_ui(ui);
        Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
        Panel::left("tools")
            .default_size(385.0)
            .size_range(300.0..=560.0)
            .show(ui, |ui| self.tools_ui(ui, &mut wishes));
        let stage = Frame::new().fill(theme::STAGE);
        CentralPanel::no_frame().frame(stage).show(ui, |ui| self.views_ui(ui, &mut wishes));

        self.grant(&ctx, wishes, now_secs);
        help::help_ui(&ctx, &mut self.help_open);
        self.waiting_ui(&ctx);
        self.leaving_ui(&ctx);
        if !self.session.is_idle() {
            ctx.request_repaint_after_secs(0.1);
        }
        self.take_screenshot(&ctx);
        self.closes_if_lost(&ctx);
    }

    /// Closes the window where its device is lost, and shows nothing: what paints the window takes a lost device that
    /// it is to paint on for a fault of the program.
    fn closes_if_lost(&mut self, ctx: &egui::Context) -> bool {
        if self.picture.viewport().is_some_and(Viewport::is_lost) {
            log::error!("the graphics device stopped answering; the window is opened again");
            self.lost = true;
            // What was on the device went with it.
            self.picture = Picture::default();
            self.sections = Default::default();
            if let Some(screenshot) = &mut self.screenshot {
                screenshot.restart();
            }
        }
        if self.lost {
            ctx.graphics_mut(|shapes| *shapes = GraphicLayers::default());
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
        self.lost
    }

    fn dropped(&mut self, ctx: &egui::Context) {
        let files = ctx.input(|i| i.raw.dropped_files.clone());
        let paths: Vec<PathBuf> = files.iter().map(|f| f.path().to_owned()).collect();
        if !paths.is_empty() {
            self.session.open(paths);
        }
    }

    fn bar_ui(&mut self, ui: &mut Ui, wishes: &mut Wishes) {
        ui.horizontal(|ui| {
            if ui.button("Open…").on_hover_text("Ctrl + O").clicked() {
                wishes.requests.push(Request::OpenFile);
            }
            if ui.button("Save").on_hover_text("Ctrl + S").clicked() {
                wishes.save = Some(false);
            }
            ui.separator();
            let history = self.session.history();
            let undo = ui.add_enabled(history.can_undo(), Button::new("Undo"));
            wishes.undo |= undo.on_hover_text("Ctrl + Z").clicked();
            let redo = ui.add_enabled(history.can_redo(), Button::new("Redo"));
            wishes.redo |= redo.on_hover_text("Ctrl + Shift + Z").clicked();
            ui.separator();
            let case = self.session.case();
            let name = if case.name.is_empty() { "unnamed case" } else { &case.name };
            let mark = if history.is_saved() { "" } else { "  (not saved)" };
            ui.label(RichText::new(format!("{name}{mark}")).strong());
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.button("?").on_hover_text("Pointer and keys").clicked() {
                    self.help_open = !self.help_open;
                }
                theme::quiet_ui(ui, "For research use only. Not a medical device.");
            });
        });
    }

    fn problems_ui(&mut self, ui: &mut Ui) {
        if self.session.problems().is_empty() {
            return;
        }
        let mut read = None;
        Panel::top("problems").show(ui, |ui| {
            for (index, problem) in self.session.problems().iter().enumerate().take(4) {
                ui.horizontal(|ui| {
                    if ui.small_button("Dismiss").clicked() {
                        read = Some(index);
                    }
                    let color = if problem.is_fault { theme::FAULT } else { theme::CAUTION };
                    ui.add(egui::Label::new(RichText::new(&problem.text).color(color)).wrap());
                });
            }
        });
        if let Some(index) = read {
            self.session.dismiss(index);
        }
    }

    fn status_ui(&mut self, ui: &mut Ui) {
        let loading = self.session.progress();
        let status = self.picture.status(loading);
        if status_ui(ui, &status) {
            self.session.cancel();
        }
    }

    fn tools_ui(&mut self, ui: &mut Ui, wishes: &mut Wishes) {
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| {
            for (id, title) in self.registry.titles() {
                if ui.selectable_label(self.active == Some(id), title).clicked() {
                    self.active = Some(id);
                }
            }
        });
        ui.separator();
        let Some(tool) = self.active.and_then(|id| self.registry.tool_mut(id)) else { return };
        let mut context = ToolContext::new(
            self.session.case(),
            self.session.assets(),
            &mut self.selection,
            &mut self.views,
            &mut wishes.edits,
            &mut wishes.requests,
        );
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.push_id(tool.id(), |ui| tool.panel_ui(&mut context, ui));
        });
    }

    fn views_ui(&mut self, ui: &mut Ui, wishes: &mut Wishes) {
        let area = ui.available_rect_before_wrap();
        let scene = scene::scene(self.session.case(), self.session.assets());
        let ball = Ball::about(scene::bounds(&scene).into_iter().flatten());
        let layers = self.views.layers(self.session.case(), self.session.assets());
        let names = names(self.session.case(), self.session.assets());
        let grids = sections::grids(self.session.case(), self.session.assets());
        for (view, rect) in layout::cells(area, self.views.only) {
            match view {
                ViewId::Spatial => self.spatial_ui(ui, rect, (&scene, &grids), ball, wishes),
                ViewId::Section(orientation) => {
                    self.section_ui(ui, (rect, orientation), ball, (&layers, &names, &grids), wishes);
                }
            }
        }
    }

    fn section_ui(
        &mut self,
        ui: &mut Ui,
        (rect, orientation): (Rect, Orientation),
        ball: Ball,
        (layers, names, grids): (&[Layer], &[(String, String)], &[ShownGrid]),
        wishes: &mut Wishes,
    ) {
        let windowed = self.selection.volume.clone();
        let mut tool = self.active.and_then(|id| self.registry.tool_mut(id));
        let input = SectionInput {
            case: self.session.case(),
            assets: self.session.assets(),
            layers,
            names,
            grids,
            windowed: windowed.as_deref(),
            ball,
            moving: ui.input(|i| i.pointer.any_down()),
            brush_mm: tool.as_ref().and_then(|tool| tool.brush_mm()),
        };
        let mut context = ToolContext::new(
            self.session.case(),
            self.session.assets(),
            &mut self.selection,
            &mut self.views,
            &mut wishes.edits,
            &mut wishes.requests,
        );
        let mut pass_on = |context: &mut ToolContext<'_>, event: &SectionEvent| {
            let Some(tool) = &mut tool else { return false };
            tool.section_pointer(context, event);
            context.is_captured()
        };
        let view = &mut self.sections[orientation.index()];
        view.ui(ui, rect, orientation, &input, &mut context, &mut pass_on);
    }

    fn spatial_ui(
        &mut self,
        ui: &mut Ui,
        rect: Rect,
        (scene, grids): (&Scene, &[ShownGrid]),
        ball: Ball,
        wishes: &mut Wishes,
    ) {
        self.draw_picture(ui, rect, scene);
        let mut overlay = Overlay::default();
        let case = self.session.case();
        let assets = self.session.assets();
        let Wishes { edits, requests, .. } = wishes;
        let mut context =
            ToolContext::new(case, assets, &mut self.selection, &mut self.views, edits, requests);
        let mut tool = self.active.and_then(|id| self.registry.tool_mut(id));
        if let Some(tool) = &tool {
            tool.draw(&context, &mut overlay);
        }
        let is_empty = scene.is_empty();
        let instead = if !self.picture.fault().is_empty() {
            self.picture.fault()
        } else if is_empty && self.session.is_idle() {
            "Drop files here, or press Open…"
        } else if is_empty {
            "loading…"
        } else {
            ""
        };
        let input = SpatialInput {
            camera: scene.camera,
            ball,
            texture: self.picture.texture().filter(|_| !is_empty),
            instead,
            background: scene.background,
            overlay: &overlay,
            grids,
        };
        let mut pass_on = |event: &PointerEvent| {
            let Some(tool) = &mut tool else { return false };
            tool.pointer(&mut context, event);
            context.is_captured()
        };
        let answer = self.spatial.ui(ui, rect, &input, &mut pass_on);
        self.answer(&answer, scene, ball, wishes);
    }

    fn answer(&mut self, answer: &SpatialAnswer, scene: &Scene, ball: Ball, wishes: &mut Wishes) {
        if let Some(camera) = answer.camera {
            wishes.edits.push(Edit::SetCamera(Some(camera)));
        }
        if answer.toggled {
            let alone = Some(ViewId::Spatial);
            self.views.only = if self.views.only == alone { None } else { alone };
        }
        if let Some(event) = answer.pick
            && let Some(place) = pick::place(scene, ball, &event.ray())
        {
            self.views.crosshair = Some(place);
        }
    }

    /// Draws the 3D picture if anything changed.
    fn draw_picture(&mut self, ui: &Ui, rect: Rect, scene: &Scene) {
        let density = ui.ctx().pixels_per_point();
        let key = PictureKey {
            case: self.session.case().clone(),
            revision: self.session.revision(),
            camera: scene.camera,
            size: [rect.width(), rect.height()].map(|s| ((s * density).round() as u32).max(1)),
        };
        // Nobody waits for a window that takes its own picture.
        self.picture.draw(ui.ctx(), scene, key, self.screenshot.is_some());
    }

    /// Does what the frame asked for.
    fn grant(&mut self, ctx: &egui::Context, wishes: Wishes, now_secs: f64) {
        if !wishes.edits.is_empty() || wishes.undo || wishes.redo {
            ctx.request_repaint();
        }
        for edit in wishes.edits {
            match &edit {
                Edit::RenameVolume { id, to } => {
                    if let Some(window) = self.views.windows.get(id).copied() {
                        self.views.windows.insert(to.clone(), window);
                    }
                    self.selection.volume = Some(to.clone());
                }
                Edit::RenameCutter { to, .. } => self.selection.cutter = Some(to.clone()),
                Edit::RenameFragment { to, .. } => self.selection.fragment = Some(to.clone()),
                Edit::RenameImplant { to, .. } => self.selection.implant = Some(to.clone()),
                Edit::ChangeGrid { change: GridChange::Rename(to), .. } => {
                    self.selection.grid = Some(to.clone());
                }
                _ => {}
            }
            self.session.edit(edit, now_secs);
        }
        if ctx.input(|i| i.pointer.any_released()) {
            self.session.end_drag();
        }
        if wishes.undo {
            self.session.undo();
        }
        if wishes.redo {
            self.session.redo();
        }
        for request in wishes.requests {
            match request {
                Request::OpenFile => self.ask(Question::OpenFiles),
                Request::OpenFolder => self.ask(Question::OpenFolder),
                Request::Fit => {
                    self.views.fit();
                    self.session.edit(Edit::SetCamera(None), now_secs);
                    ctx.request_repaint();
                }
            }
        }
        if let Some(elsewhere) = wishes.save {
            self.save(elsewhere);
        }
        if let Some((question, paths)) = self.dialog.as_ref().and_then(Dialog::answer) {
            self.dialog = None;
            self.answered(question, paths);
        }
    }

    fn ask(&mut self, question: Question) {
        if self.dialog.is_some() {
            return;
        }
        match Dialog::open(question, Arc::clone(&self.wake)) {
            Ok(dialog) => self.dialog = Some(dialog),
            Err(error) => {
                self.session.complain(format!("no file dialog ({error}); drop the file on the window"));
            }
        }
    }

    fn answered(&mut self, question: Question, paths: Vec<PathBuf>) {
        match question {
            Question::OpenFiles | Question::OpenFolder => self.session.open(paths),
            Question::SaveCase => {
                let saved = paths.first().is_some_and(|path| self.session.save(&with_ending(path)));
                if self.leaving == Leaving::Saving {
                    self.leaving = if saved { Leaving::Allowed } else { Leaving::No };
                }
            }
        }
    }

    /// Saves to the case's file, or asks for one.
    fn save(&mut self, elsewhere: bool) -> bool {
        match self.session.path().map(PathBuf::from) {
            Some(path) if !elsewhere => self.session.save(&path),
            _ => {
                self.ask(Question::SaveCase);
                false
            }
        }
    }

    /// Asks before another case takes the place of one with changes.
    fn waiting_ui(&mut self, ctx: &egui::Context) {
        if self.session.waiting().is_none() {
            return;
        }
        egui::Modal::new(egui::Id::unique("waiting")).show(ctx, |ui| {
            ui.label("This case has changes that are not saved. Open the other one and lose them?");
            ui.horizontal(|ui| {
                if ui.button("Open and lose the changes").clicked() {
                    self.session.settle(true);
                }
                if ui.button("Keep this case").clicked() {
                    self.session.settle(false);
                }
            });
        });
    }

    /// Asks before the window closes on changes.
    fn leaving_ui(&mut self, ctx: &egui::Context) {
        let unsaved = !self.session.history().is_saved();
        if ctx.input(|i| i.viewport().close_requested()) && unsaved && self.leaving != Leaving::Allowed {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.leaving = Leaving::Asked;
        }
        if self.leaving == Leaving::Asked {
            egui::Modal::new(egui::Id::unique("leaving")).show(ctx, |ui| {
                ui.label("This case has changes that are not saved.");
                ui.horizontal(|ui| {
                    if ui.button("Save and close").clicked() {
                        self.leaving = Leaving::Saving;
                        if self.save(false) {
                            self.leaving = Leaving::Allowed;
                        }
                    }
                    if ui.button("Close and lose them").clicked() {
                        self.leaving = Leaving::Allowed;
                    }
                    if ui.button("Stay").clicked() {
                        self.leaving = Leaving::No;
                    }
                });
            });
        }
        if self.leaving == Leaving::Allowed {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn take_screenshot(&mut self, ctx: &egui::Context) {
        let Case { volumes, implants, grids, .. } = self.session.case();
        let shows = !(volumes.is_empty() && implants.is_empty() && grids.is_empty());
        let at_rest = self.session.is_idle() && self.picture.is_at_rest(shows);
        let Some(done) = self.screenshot.as_mut().and_then(|s| s.step(ctx, at_rest)) else { return };
        if let Err(error) = done {
            *self.screenshot_fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
        self.screenshot = None;
        self.leaving = Leaving::Allowed;
        ctx.send_viewport_cmd(egui::ViewportCommand::Close);
    }
}

impl Drop for Host {
    /// A fault in what draws the window must not take the plan along.
    fn drop(&mut self) {
        if std::thread::panicking() {
            log::error!("the window ended because of a fault: {}", loss::rescue(&mut self.session));
        }
    }
}

fn keys(ctx: &egui::Context, wishes: &mut Wishes) {
    // The longer shortcuts first: egui takes a shorter one for them otherwise.
    ctx.input_mut(|i| {
        wishes.redo |= i.consume_shortcut(&REDO);
        wishes.undo |= i.consume_shortcut(&UNDO);
        if i.consume_shortcut(&SAVE_AS) {
            wishes.save = Some(true);
        }
        if i.consume_shortcut(&SAVE) {
            wishes.save = Some(false);
        }
        if i.consume_shortcut(&OPEN) {
            wishes.requests.push(Request::OpenFile);
        }
    });
}

/// Names and units of the volumes that [`Views::layers`] shows, in the same order.
fn names(case: &Case, loaded: &assets::Assets) -> Vec<(String, String)> {
    let shown = case.volumes.iter().filter(|v| v.visible);
    let named = shown.filter_map(|volume| {
        let grid = loaded.grid(volume)?;
        let is_lossy = loaded.steps(volume).is_some_and(|steps| steps.is_lossy());
        let lossy = if is_lossy { " (lossy)" } else { "" };
        Some((volume.id.clone(), format!("{}{lossy}", sections::unit(loaded, volume, &grid))))
    });
    named.collect()
}

/// A file name with the case's ending, where none was typed.
fn with_ending(path: &std::path::Path) -> PathBuf {
    if path.extension().is_some() { path.to_owned() } else { path.with_extension("json") }
}
