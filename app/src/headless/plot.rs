//! Small SVG charts: points of one or more series over two axes, one of which may be logarithmic.

/// Points of one colour and name.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// For the legend.
    pub name: String,
    /// `(x, y)`, with a label each; points that are not finite are left out.
    pub points: Vec<(f64, f64, String)>,
}

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// From 0, in equal parts.
    Linear,
    /// In powers of ten.
    Log,
}

/// A chart of run time against error.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Under the horizontal axis, with its unit; the axis is logarithmic.
    pub x: String,
    /// Beside the vertical axis, with its unit.
    pub y: String,
    /// Of the vertical axis.
    pub y_scale: Scale,
    /// Whether lines go from point to point of a series, in their order.
    pub joined: bool,
    /// What is drawn.
    pub series: Vec<Series>,
}

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
/// Left, top, right and bottom of the frame.
const FRAME: [f64; 4] = [70.0, 40.0, 560.0, 390.0];
/// Told apart with the usual kinds of colour blindness (Okabe and Ito, 2008). Series beyond them have hollow dots.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

impl Chart {
    /// The SVG document.
    pub fn svg(&self) -> String {
        let log = self.y_scale == Scale::Log;
        let finite =
            |p: &&(f64, f64, String)| p.0 > 0.0 && p.0.is_finite() && p.1.is_finite() && (p.1 > 0.0 || !log);
        let all: Vec<&(f64, f64, String)> =
            self.series.iter().flat_map(|s| &s.points).filter(finite).collect();
        let [low, high] = decades(all.iter().map(|p| p.0));
        let heights = if log {
            decades(all.iter().map(|p| p.1))
        } else {
            [0.0, all.iter().map(|p| p.1).fold(1.0, f64::max) * 1.08]
        };
        let [left, upper, right, lower] = FRAME;
        let x = |v: f64| left + (v.log10() - low) / (high - low) * (right - left);
        let y = |v: f64| {
            let v = if log { v.log10() } else { v };
            lower - (v - heights[0]) / (heights[1] - heights[0]) * (lower - upper)
        };

        let mut lines = vec![
            format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
                 viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">"
            ),
            "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>".to_owned(),
            format!(
                "<rect x=\"{left}\" y=\"{upper}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>",
                right - left,
                lower - upper
            ),
            text([WIDTH / 2.0, 24.0], "middle", &self.title),
            text([f64::midpoint(left, right), lower + 36.0], "middle", &self.x),
            text([8.0, upper - 10.0], "start", &self.y),
        ];
        for power in low as i32..=high as i32 {
            let value = 10.0_f64.powi(power);
            lines.push(text([x(value), lower + 18.0], "middle", &value.to_string()));
        }
        if log {
            for power in heights[0] as i32..=heights[1] as i32 {
                let value = 10.0_f64.powi(power);
                lines.push(text([left - 6.0, y(value) + 4.0], "end", &format!("{value:e}")));
            }
        } else {
            for tick in 0..=4 {
                let value = heights[1] * f64::from(tick) / 4.0;
                lines.push(text([left - 6.0, y(value) + 4.0], "end", &format!("{value:.1}")));
            }
        }
        for (i, series) in self.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let fill = if (i / COLOURS.len()).is_multiple_of(2) { colour } else { "white" };
            let row = upper + 10.0 + 20.0 * i as f64;
            lines.push(dot([right + 18.0, row], colour, fill));
            lines.push(text([right + 28.0, row + 4.0], "start", &series.name));
            if self.joined {
                let points = series.points.iter().filter(finite);
                let path: Vec<String> = points.map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
                let path = path.join(" ");
                lines.push(format!("<polyline points=\"{path}\" fill=\"none\" stroke=\"{colour}\"/>"));
            }
            for (px, py, label) in series.points.iter().filter(finite) {
                lines.push(dot([x(*px), y(*py)], colour, fill));
                lines.push(text([x(*px) + 7.0, y(*py) - 5.0], "start", label));
            }
        }
        lines.push("</svg>\n".to_owned());
        lines.join("\n")
    }
}

/// Powers of ten that hold all values, at least one decade: without values there is one all the same.
fn decades(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let powers = values.map(f64::log10);
    let low = powers.clone().fold(f64::INFINITY, f64::min).floor();
    let high = powers.fold(f64::NEG_INFINITY, f64::max).ceil();
    if low > high { [0.0, 1.0] } else { [low, high.max(low + 1.0)] }
}

fn dot([x, y]: [f64; 2], colour: &str, fill: &str) -> String {
    format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{colour}\"/>")
}

fn text([x, y]: [f64; 2], anchor: &str, what: &str) -> String {
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>", escaped(what))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64, String)>) -> String {
        scaled(points, Scale::Linear)
    }

    fn scaled(points: Vec<(f64, f64, String)>, y_scale: Scale) -> String {
        let series = vec![Series { name: "a < b".to_owned(), points }];
        let (title, x, y) = ("t".to_owned(), "ms".to_owned(), "dB".to_owned());
        Chart { title, x, y, y_scale, joined: y_scale == Scale::Log, series }.svg()
    }

    #[test]
    fn a_point_lies_where_its_numbers_say() {
        let svg = chart(vec![
            (10.0, 0.0, "p".to_owned()),
            (1000.0, 40.0, "q".to_owned()),
            (5.0, f64::INFINITY, "lossless".to_owned()),
        ]);
        let [left, _, right, lower] = FRAME;
        let dots: Vec<&str> = svg.lines().filter(|l| l.starts_with("<circle")).collect();
        assert_eq!(dots.len(), 3, "the legend and two finite points");
        assert!(dots[1].contains(&format!("cx=\"{left:.1}\" cy=\"{lower:.1}\"")), "{}", dots[1]);
        assert!(dots[2].contains(&format!("cx=\"{right:.1}\"")), "{}", dots[2]);
        assert!(svg.contains("a &lt; b"), "text is escaped");
    }

    #[test]
    fn ten_times_as_much_is_a_decade_on_a_logarithmic_axis() {
        let point = |y: f64| (1.0, y, String::new());
        let svg = scaled(vec![point(1e-3), point(0.0), point(1e-2), point(1e-1)], Scale::Log);
        let heights: Vec<f64> = svg
            .lines()
            .filter(|l| l.starts_with("<circle"))
            .skip(1)
            .map(|l| {
                l.split("cy=\"")
                    .nth(1)
                    .and_then(|t| t.split('"').next())
                    .and_then(|t| t.parse().ok())
                    .unwrap_or(0.0)
            })
            .collect();
        assert_eq!(heights, [390.0, 215.0, 40.0], "bottom, middle and top; nought has no logarithm");
        assert!(svg.contains("<polyline points=\"70.0,390.0 70.0,215.0 70.0,40.0\""), "{svg}");
    }

    #[test]
    fn no_two_of_twelve_series_look_alike() {
        let one = |i: usize| Series { name: i.to_string(), points: Vec::new() };
        let (title, x, y) = ("t".to_owned(), "ms".to_owned(), "dB".to_owned());
        let series = (0..12).map(one).collect();
        let svg = Chart { title, x, y, y_scale: Scale::Linear, joined: true, series }.svg();
        let looks = svg.lines().filter(|l| l.starts_with("<circle")).filter_map(|l| l.split("fill").nth(1));
        let looks: std::collections::BTreeSet<&str> = looks.collect();
        assert_eq!(looks.len(), 12, "{looks:?}");
    }

    #[test]
    fn a_chart_without_points_is_still_a_chart() {
        let svg = chart(Vec::new());
        assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}
