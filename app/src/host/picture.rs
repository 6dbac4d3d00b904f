//! The 3D picture from frame to frame: asked for when something changed, taken in when it comes.

use egui::{Context, TextureId};
use render::gpu::GpuError;
use render::renderer::{Quality, Stats};
use render::scene::{Camera, Scene};

use super::pacer::{Need, Pacer};
use super::processor::{Order, Tag};
use super::status::Status;
use super::viewport::{Outcome, Viewport};
use crate::case::Case;
use crate::jobs::Step;

/// All that a picture depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureKey {
    /// The plan.
    pub case: Case,
    /// Grows when data arrive.
    pub revision: u64,
    /// The view.
    pub camera: Camera,
    /// Pixels.
    pub size: [u32; 2],
}

/// The picture, its device and its pace.
#[derive(Debug)]
pub struct Picture {
    pacer: Pacer<PictureKey>,
    viewport: Option<Viewport>,
    /// Of the order last given.
    number: u64,
    stats: Option<Stats>,
    size: [u32; 2],
    scale: f64,
    fault: String,
}

impl Default for Picture {
    /// None, without a device.
    fn default() -> Self {
        Self {
            pacer: Pacer::default(),
            viewport: None,
            number: 0,
            stats: None,
            size: [0, 0],
            scale: 1.0,
            fault: "no graphics device".to_owned(),
        }
    }
}

impl Picture {
    /// A picture on a device, or why there is none.
    pub fn new(viewport: Result<Viewport, GpuError>) -> Self {
        match viewport {
            Ok(viewport) => Self { viewport: Some(viewport), fault: String::new(), ..Self::default() },
            Err(error) => Self { fault: error.to_string(), ..Self::default() },
        }
    }

    /// The device, where there is one.
    pub fn viewport(&self) -> Option<&Viewport> {
        self.viewport.as_ref()
    }

    /// Why there is no picture; empty where there may be one.
    pub fn fault(&self) -> &str {
        &self.fault
    }

    /// The picture on the screen, once there is one.
    pub fn texture(&self) -> Option<TextureId> {
        self.viewport.as_ref().and_then(Viewport::texture)
    }

    /// What the status line says of it.
    pub fn status(&self, loading: Option<(String, Step)>) -> Status<'_> {
        Status {
            adapter: self.viewport.as_ref().map_or(self.fault.as_str(), Viewport::adapter),
            stats: self.stats.as_ref(),
            size: self.size,
            is_reduced: self.pacer.is_at_rest() && self.scale < 1.0,
            loading,
        }
    }

    /// Whether no better picture is to come, of a case with something to draw (`shows`) or without.
    pub fn is_at_rest(&self, shows: bool) -> bool {
        let draws = self.viewport.is_some() && self.fault.is_empty();
        !draws || !shows || self.pacer.is_at_rest()
    }

    /// Takes in what was drawn and asks for what is needed: a picture if anything changed, roughly at first. The good
    /// one has all its pixels where nobody waits for it (`is_patient`) or the window goes on meanwhile.
    pub fn draw(&mut self, ctx: &Context, scene: &Scene, key: PictureKey, is_patient: bool) {
        self.take_in();
        let Some(viewport) = &mut self.viewport else { return };
        if scene.is_empty() {
            return;
        }
        let (quality, scale) = match self.pacer.need(&key, ctx.input(|i| i.time)) {
            Need::Nothing => return,
            Need::Later(secs) => {
                ctx.request_repaint_after_secs(secs as f32);
                return;
            }
            Need::Draft { scale } => (Quality::Draft, scale),
            Need::Good { .. } if is_patient || viewport.draws_beside(scene) => (Quality::Good, 1.0),
            Need::Good { scale } => (Quality::Good, scale),
        };
        self.number += 1;
        let size = key.size.map(|s| ((f64::from(s) * scale) as u32).max(1));
        let tag = Tag { number: self.number, size, scale, quality };
        if quality == Quality::Draft {
            self.pacer.drafts(key);
        } else {
            self.pacer.refines();
        }
        viewport.ask(Order { tag, scene: scene.clone() });
        self.take_in();
        if self.pacer.is_drafted() {
            ctx.request_repaint_after_secs(super::pacer::REST_SECS as f32);
        }
    }

    fn take_in(&mut self) {
        while let Some(Outcome { tag, drawn }) = self.viewport.as_mut().and_then(Viewport::finished) {
            let is_newest = tag.number == self.number;
            match drawn {
                Ok(stats) => {
                    if tag.quality == Quality::Draft {
                        self.pacer.drafted(is_newest, tag.scale, stats.frame_ms - stats.prepare_ms);
                    } else if is_newest {
                        self.pacer.rests();
                    }
                    self.stats = Some(stats);
                    (self.size, self.scale) = (tag.size, tag.scale);
                    self.fault.clear();
                }
                Err(error) => {
                    self.fault = error.to_string();
                    // The same picture would fail again: wait for another.
                    if is_newest {
                        self.pacer.rests();
                    }
                }
            }
        }
    }
}
