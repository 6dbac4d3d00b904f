//! The panel of the player.

use egui::{Button, DragValue, RichText, Slider, Ui};

use super::Player;
use crate::case::{Edit, Volume};
use crate::host::context::ToolContext;
use crate::steps::clock::{Due, SPEEDS};
use crate::steps::{Direction, Repeat, Steps};
use crate::ui::theme;

pub(super) fn show_ui(player: &mut Player, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    let moving: Vec<&Volume> =
        ctx.case.volumes.iter().filter(|v| v.visible && ctx.assets.steps(v).is_some()).collect();
    let chosen = |id: &Option<String>| moving.iter().find(|v| id.as_ref() == Some(&v.id)).copied();
    let volume = chosen(&player.volume).or_else(|| chosen(&ctx.selection.volume)).or(moving.first().copied());
    let Some((volume, steps)) = volume.and_then(|v| Some((v, ctx.assets.steps(v)?))) else {
        theme::quiet_ui(
            ui,
            "No volume over time is shown. Open one: a 4D NIfTI or NRRD file, a DICOM series with",
        );
        theme::quiet_ui(ui, "temporal positions, a folder of numbered volumes, or an .ovs file.");
        player.clock.stop();
        return;
    };
    if player.volume.as_ref() != Some(&volume.id) {
        player.clock.stop();
        player.volume = Some(volume.id.clone());
    }
    if moving.len() > 1 {
        ui.horizontal_wrapped(|ui| {
            for other in &moving {
                if ui.selectable_label(other.id == volume.id, &other.id).clicked() {
                    player.volume = Some(other.id.clone());
                }
            }
        });
    } else {
        ui.label(RichText::new(&volume.id).strong());
    }
    let times = steps.times_secs();
    let shown = volume.step.min(times.len() - 1);
    let now_secs = ui.input(|i| i.time);
    if let Some(wish) = buttons_ui(player, ui, shown, times, now_secs) {
        player.clock.stop();
        ctx.edit(Edit::SetStep { id: volume.id.clone(), step: wish });
    } else {
        play(player, ctx, volume, steps, shown, now_secs);
    }
    if player.clock.is_playing() {
        ui.ctx().request_repaint();
    }
    facts_ui(player, ui, steps, now_secs);
}

/// The controls; the step that the user went to.
fn buttons_ui(player: &mut Player, ui: &mut Ui, shown: usize, times: &[f64], now_secs: f64) -> Option<usize> {
    let last = times.len() - 1;
    let mut wish = None;
    ui.horizontal(|ui| {
        let clock = &mut player.clock;
        if ui.button("First").clicked() {
            wish = Some(0);
        }
        if ui.add_enabled(shown > 0, Button::new("Back")).clicked() {
            wish = Some(shown.saturating_sub(1));
        }
        if clock.is_playing() {
            if ui.button("Pause").clicked() {
                clock.stop();
            }
        } else if ui.add_enabled(last > 0, Button::new("Play")).clicked() {
            clock.play(now_secs, shown, times);
        }
        if ui.add_enabled(shown < last, Button::new("Next")).clicked() {
            wish = Some((shown + 1).min(last));
        }
        if ui.button("Last").clicked() {
            wish = Some(last);
        }
    });
    let mut at = shown;
    ui.spacing_mut().slider_width = 260.0;
    let axis = ui.add(Slider::new(&mut at, 0..=last).text("step"));
    if axis.changed() && at != shown {
        wish = Some(at);
    }
    let secs = times.get(shown).copied().unwrap_or_default();
    ui.label(format!("step {} of {}, {secs:.3} s", shown + 1, times.len()));
    ui.horizontal(|ui| {
        let clock = &mut player.clock;
        let (speed, direction) = clock.speed();
        let (mut new_speed, mut back) = (speed, direction == Direction::Backward);
        ui.add(
            DragValue::new(&mut new_speed)
                .range(SPEEDS[0]..=SPEEDS[1])
                .speed(0.02)
                .prefix("speed ")
                .suffix(" ×"),
        );
        ui.checkbox(&mut back, "backwards");
        let mut looped = clock.repeat == Repeat::Loop;
        ui.checkbox(&mut looped, "loop");
        clock.repeat = if looped { Repeat::Loop } else { Repeat::Once };
        let new_direction = if back { Direction::Backward } else { Direction::Forward };
        if new_speed != speed || new_direction != direction {
            clock.set_speed(new_speed, new_direction, now_secs, shown, times);
        }
    });
    wish
}

/// Shows what is due if it is there, and asks for what comes next.
fn play(
    player: &mut Player,
    ctx: &mut ToolContext<'_>,
    volume: &Volume,
    steps: &Steps,
    shown: usize,
    now_secs: f64,
) {
    let times = steps.times_secs();
    let direction = player.clock.speed().1;
    match player.clock.due(now_secs, shown, times) {
        Due::Same => {}
        // Where it stops, the last step is waited for.
        Due::End(end) => {
            player.clock.show(shown, end, times.len());
            ctx.edit(Edit::SetStep { id: volume.id.clone(), step: end });
        }
        Due::Step(due) => {
            steps.want(due, direction, player.clock.repeat);
            if steps.is_ready(due) {
                player.clock.show(shown, due, times.len());
                ctx.edit(Edit::SetStep { id: volume.id.clone(), step: due });
            }
        }
    }
}

fn facts_ui(player: &Player, ui: &mut Ui, steps: &Steps, now_secs: f64) {
    if player.clock.is_playing() {
        let (shown, dropped) = player.clock.counts();
        let rate = player.clock.rate(now_secs);
        theme::quiet_ui(ui, format!("{rate:.1} steps a second; {shown} shown, {dropped} dropped"));
    }
    theme::quiet_ui(ui, steps.description());
}
