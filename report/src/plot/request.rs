//! Requests for a drawing of a recording.

use serde::Serialize;

/// Request for a drawing of a recording.
///
/// ```
/// use report::plot::{Request, Span, View};
/// let span = Span { from_s: 1.0, to_s: Some(3.0) };
/// let request = Request { views: vec![View::Top], span, ..Request::default() };
/// assert!(request.plots.is_empty() && request.vehicle.is_none(), "every vehicle, with what its topics suggest");
/// ```
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Axes over time, each as `TOPIC:FIELD[,TOPIC:FIELD…]`; if empty, those for the types of the topics.
    pub plots: Vec<String>,
    /// Views; where empty, a page has all and a picture has curves over time.
    pub views: Vec<View>,
    /// The only vehicle; all where absent.
    pub vehicle: Option<String>,
    /// Simulated time that is drawn.
    pub span: Span,
    /// Counts of a motor command at full throttle: commands are drawn in % of it then.
    pub full_throttle: Option<f64>,
    /// `TOPIC:FIELD`, a number: the curves are drawn against it instead of time, each sample against the last that came
    /// before it or with it.
    pub against: Option<String>,
    /// Title; the name of the recording's file where absent.
    pub title: Option<String>,
}

/// A way to look at a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum View {
    /// Curves over time.
    Time,
    /// The paths in space, with the scene.
    Path,
    /// The paths from above.
    Top,
    /// The paths from the side.
    Side,
}

/// The span of simulated time that is drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// First time in seconds.
    pub from_s: f64,
    /// Last time in seconds, if there is one.
    pub to_s: Option<f64>,
}

impl Span {
    /// Half a nanosecond of slack: limits in seconds are not exact in binary.
    pub(super) fn holds(self, time_s: f64) -> bool {
        time_s >= self.from_s - 5e-10 && self.to_s.is_none_or(|to_s| time_s <= to_s + 5e-10)
    }
}

/// A kind of file that shows a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// A page that needs no network.
    Html,
    /// A picture of dots.
    Png,
    /// A picture of lines.
    Svg,
}

impl Format {
    /// The views that a file shows if none is requested.
    pub(super) fn usual_views(self) -> &'static [View] {
        match self {
            Self::Html => &[View::Time, View::Path, View::Top, View::Side],
            Self::Png | Self::Svg => &[View::Time],
        }
    }
}
