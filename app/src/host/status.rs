//! The line at the bottom: what draws, how, how fast, and what is being loaded.

use egui::{ProgressBar, RichText, Ui};
use render::TextureSummary;
use render::renderer::Stats;

use crate::jobs::Step;
use crate::ui::theme;

/// What the line shows.
#[derive(Debug)]
pub struct Status<'a> {
    /// The adapter's name, or why there is none.
    pub adapter: &'a str,
    /// The last picture, once there is one.
    pub stats: Option<&'a Stats>,
    /// The picture's size in pixels.
    pub size: [u32; 2],
    /// Whether the picture at rest has fewer pixels than the view, for speed.
    pub is_reduced: bool,
    /// What is being loaded.
    pub loading: Option<(String, Step)>,
}

/// Draws the line; whether the load is to be cancelled.
pub fn status_ui(ui: &mut Ui, status: &Status<'_>) -> bool {
    let mut cancelled = false;
    ui.horizontal(|ui| {
        theme::quiet_ui(ui, status.adapter);
        if let Some(stats) = status.stats {
            ui.separator();
            let [width, height] = status.size;
            theme::quiet_ui(ui, format!("{width} × {height} in {:.0} ms", stats.frame_ms));
            if status.is_reduced {
                let words = RichText::new("fewer pixels, as this GPU is slow").small().color(theme::CAUTION);
                ui.label(words);
            }
            let textures = textures(stats);
            if !textures.is_empty() {
                ui.separator();
                theme::quiet_ui(ui, textures);
            }
            if let Some(loss) = loss(stats) {
                ui.separator();
                ui.label(RichText::new(loss).small().color(theme::CAUTION));
            }
            if !stats.notes.is_empty() {
                let words =
                    RichText::new(format!("{} notes", stats.notes.len())).small().color(theme::CAUTION);
                ui.label(words).on_hover_text(stats.notes.join("\n"));
            }
        }
        if let Some((name, step)) = &status.loading {
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                cancelled = ui.small_button("Cancel").clicked();
                let bar = match step.part() {
                    Some(part) => ProgressBar::new(part).show_percentage(),
                    None => ProgressBar::new(0.0).animate(true),
                };
                ui.add(bar.desired_width(140.0));
                let doing = if step.doing.is_empty() { "loading" } else { &step.doing };
                theme::quiet_ui(ui, format!("{name}: {doing}"));
            });
        }
    });
    cancelled
}

/// The formats in use and their memory: `"R16 + BC4, 34.5 MiB"`.
fn textures(stats: &Stats) -> String {
    let mut names: Vec<String> = stats.textures.iter().map(name).collect();
    names.dedup();
    if names.is_empty() {
        return String::new();
    }
    let bytes: u64 = stats.textures.iter().map(|t| t.bytes).sum();
    format!("{}, {:.1} MiB", names.join(" + "), bytes as f64 / f64::from(1 << 20))
}

/// What is lost in the picture, of the worst texture; none where all are exact.
fn loss(stats: &Stats) -> Option<String> {
    let lossy = stats.textures.iter().filter(|t| t.psnr_db.is_finite());
    let worst = lossy.min_by(|a, b| a.psnr_db.total_cmp(&b.psnr_db))?;
    let unit = if worst.stored.is_colour() { "/255" } else { "" };
    let voxels = worst.extent.iter().map(|n| f64::from(*n)).product::<f64>();
    let bits = worst.bytes as f64 * 8.0 / voxels.max(1.0);
    Some(format!(
        "lossy {}: {bits:.0} bits a voxel, largest error {:.3}{unit}, PSNR {:.1} dB",
        name(worst),
        worst.max_error,
        worst.psnr_db
    ))
}

fn name(texture: &TextureSummary) -> String {
    texture.stored.to_string().to_uppercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::Stored;
    use render::scene::TextureFormat;

    fn texture(format: TextureFormat, max_error: f64, psnr_db: f64) -> TextureSummary {
        let stored = Stored::Grid(format);
        TextureSummary { stored, extent: [64, 64, 64], bytes: 1 << 17, max_error, psnr_db, generate_ms: 1.0 }
    }

    #[test]
    fn a_lossy_picture_says_so_with_format_ratio_and_error() {
        let exact = texture(TextureFormat::R16, 0.0, f64::INFINITY);
        let lossy = texture(TextureFormat::Bc4, 12.5, 61.2);
        let stats = Stats { textures: vec![exact.clone(), lossy], ..Stats::default() };
        let words = loss(&stats).expect("a note");
        assert_eq!(words, "lossy BC4: 4 bits a voxel, largest error 12.500, PSNR 61.2 dB", "all three");
        assert_eq!(textures(&stats), "R16 + BC4, 0.2 MiB", "formats and bytes");
        let stats = Stats { textures: vec![exact], ..Stats::default() };
        assert_eq!(loss(&stats), None, "an exact picture says nothing");
    }
}
