//! Drawing of a view: title, vehicles, processes, topics, and the keys. 80 × 24 characters are enough for hover.toml.

use crate::cells::Cells;
use crate::top::view::{View, only_vehicle, processes, title, topics, vehicles};
use diagnostics::printable_line;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Text};
use ratatui::widgets::{Cell, Row, Table, Widget};
use runtime::ctl::protocol::State;

const KEYS: &str = "space pause  s step  S 100  + - speed  f free  r realtime  x stop  q leave";
/// Widths of the columns: of numbers in characters, of text as shares of the remaining width.
const VEHICLE_WIDTHS: [u16; 6] = [1, 9, 9, 7, 7, 7];
const PROCESS_WIDTHS: [u16; 7] = [3, 7, 9, 5, 7, 7, 5];
const TOPIC_WIDTHS: [u16; 5] = [2, 1, 9, 10, 5];

/// A view on its way to the screen.
pub struct Screen<'a> {
    /// The view.
    pub view: &'a View,
    /// Notice or question for the user.
    pub notice: &'a str,
    /// Rows of each table that are scrolled over.
    pub scroll: usize,
}

impl Widget for Screen<'_> {
    fn render(self, area: Rect, buffer: &mut Buffer) {
        let (processes, topics) = (processes(self.view), topics(self.view));
        let vehicles = vehicles(self.view);
        let flown_lines = vehicle_lines(area.height, vehicles.rows.len());
        let height = area.height.saturating_sub(6 + flown_lines);
        let process_lines = share_of(height, processes.rows.len(), topics.rows.len());
        let [head, flown, first, _, second, notice, keys] = Layout::vertical([
            Constraint::Length(3),
            Constraint::Length(flown_lines),
            Constraint::Length(process_lines),
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(1),
            Constraint::Length(1),
        ])
        .areas(area);
        let [run, progress] = title(self.view);
        let run = printable_line(&run);
        let state = Line::raw(only_vehicle(self.view));
        let lines = [Line::styled(run, title_style(self.view.status.state)), Line::raw(progress), state];
        Text::from_iter(lines).render(head, buffer);
        table(&vehicles, &VEHICLE_WIDTHS, self.scroll, flown.height.saturating_sub(1)).render(flown, buffer);
        table(&processes, &PROCESS_WIDTHS, self.scroll, first.height).render(first, buffer);
        table(&topics, &TOPIC_WIDTHS, self.scroll, second.height).render(second, buffer);
        Line::raw(printable_line(self.notice)).bold().render(notice, buffer);
        Line::raw(KEYS).dim().render(keys, buffer);
    }
}

/// Lines for `vehicles` of a screen of `height` lines, with the heading and an empty line behind them: a quarter of the screen at most.
fn vehicle_lines(height: u16, vehicles: usize) -> u16 {
    let lines = |rows: usize| u16::try_from(rows + 2).unwrap_or(u16::MAX);
    if vehicles == 0 { 0 } else { lines(vehicles).min(height / 4) }
}

/// Lines for the processes of `height` lines for both tables, each with its heading: the lines that both need if
/// there is room, else at least half.
fn share_of(height: u16, processes: usize, topics: usize) -> u16 {
    let lines = |rows: usize| u16::try_from(rows + 1).unwrap_or(u16::MAX);
    lines(processes).min((height / 2).max(height.saturating_sub(lines(topics))))
}

fn title_style(state: State) -> Style {
    let color = match state {
        State::Running => Color::Green,
        State::Paused | State::Pausing | State::Stepping => Color::Yellow,
        State::Stopping | State::Ended => Color::Red,
        State::Starting => Color::Blue,
    };
    Style::new().fg(color).bold()
}

fn table(cells: &Cells, widths: &[u16], scroll: usize, height: u16) -> Table<'static> {
    let width = |(width, is_number): (&u16, &bool)| {
        if *is_number { Constraint::Length(*width) } else { Constraint::Fill(*width) }
    };
    let widths = widths.iter().zip(&cells.is_number).map(width);
    let row = |texts: &Vec<String>| {
        let aligned = |(text, is_number): (&String, &bool)| {
            let line = Line::raw(printable_line(text).into_owned());
            Cell::new(if *is_number { line.right_aligned() } else { line })
        };
        Row::new(texts.iter().zip(&cells.is_number).map(aligned).collect::<Vec<_>>())
    };
    let hidden = cells.rows.len().saturating_sub(usize::from(height.saturating_sub(1)));
    let rows = cells.rows.iter().skip(scroll.min(hidden)).map(row).collect::<Vec<_>>();
    Table::new(rows, widths).header(row(&cells.headings).dim()).column_spacing(1)
}

#[cfg(test)]
mod tests {
    use super::{KEYS, Screen};
    use crate::top::view::{ProcessRow, TopicRow, VehicleRow, View};
    use bus::plan::Pace;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use runtime::ctl::protocol::{State, Status};
    use runtime::manifest::PaceSetting;

    fn view(rows: usize) -> View {
        let process = |index| ProcessRow {
            group: None,
            name: format!("process-{index}"),
            process: Some(7),
            state: "waits for /attitude/estimate".to_owned(),
            tick: 12_345,
            cpu_share: Some(0.256),
            step_p50_us: Some(1.25),
            step_p99_us: None,
            late: 3,
        };
        let topic = |index| TopicRow {
            name: format!("/process-{index}/estimate"),
            publisher: format!("process-{index}"),
            rate_hz: 999.7,
            samples: 12_345,
            lost: 0,
        };
        View {
            manifest: "/somewhere/hover.toml".to_owned(),
            status: Status {
                run_id: "1f-2e".to_owned(),
                state: State::Paused,
                tick: 12_345,
                end_tick: 60_000,
                time_s: 12.345,
                pace: PaceSetting(Pace::Factor(0.5)),
                missed_deadlines: 2,
                groups: vec![],
            },
            span_s: 1.0,
            real_time_factor: 0.4999,
            vehicles: vec![],
            processes: (0..rows).map(process).collect(),
            topics: (0..rows).map(topic).collect(),
        }
    }

    fn drawn(view: &View, (width, height): (u16, u16), scroll: usize) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let screen = Screen { view, notice: "paused at tick 12345", scroll };
        terminal.draw(|frame| frame.render_widget(screen, frame.area())).unwrap();
        let buffer = terminal.backend().buffer();
        let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned();
        (0..height).map(row).collect()
    }

    #[test]
    fn a_terminal_of_80_by_24_shows_everything_of_a_run_like_hover() {
        let lines = drawn(&view(8), (80, 24), 0);
        let expected = [
            "hover.toml  run 1f-2e  paused",
            "tick 12345 / 60000  12.345 s  0.50 × real time  pace 0.5  2 deadlines missed",
            "",
            "process      state                              tick CPU %  p50 µs  p99 µs  late",
            "process-0    waits for /attitude/estimate      12345    26     1.2       -     3",
        ];
        assert_eq!(lines[..5], expected);
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&lines[13]), ["topic", "publisher", "rate", "Hz", "samples", "lost"]);
        assert_eq!(words(&lines[21]), ["/process-7/estimate", "process-7", "1000", "12345", "0"]);
        assert_eq!(lines[22..], ["paused at tick 12345", KEYS]);
    }

    #[test]
    fn one_vehicle_has_a_line_and_several_have_a_table() {
        let row = |name: &str| VehicleRow {
            name: name.to_owned(),
            height_m: Some(1.4985),
            speed_m_s: Some(0.02),
            roll_deg: Some(-9.96),
            pitch_deg: Some(0.0),
            ..VehicleRow::default()
        };
        let mut view = view(8);
        view.vehicles = vec![row("plant")];
        let lines = drawn(&view, (80, 24), 0);
        assert_eq!(lines[2], "height 1.498 m  speed 0.02 m/s  roll -10.0°  pitch 0.0°  yaw -°");
        view.vehicles = vec![row("h1"), row("h2")];
        let lines = drawn(&view, (80, 24), 0);
        assert!(lines[3].starts_with("vehicle") && lines[3].ends_with("yaw °"), "{lines:#?}");
        assert!(lines[5].starts_with("h2") && lines[5].ends_with("-10.0     0.0       -"), "{lines:#?}");
        assert!(lines[7].starts_with("process  "), "{lines:#?}");
    }

    #[test]
    fn names_and_answers_are_shown_and_not_obeyed() {
        let hostile = "a\u{1b}[2J\u{202e}\u{200b}b";
        let mut view = view(1);
        view.manifest = hostile.to_owned();
        view.processes[0].name = hostile.to_owned();
        view.topics[0].name = hostile.to_owned();
        let mut terminal = Terminal::new(TestBackend::new(120, 12)).unwrap();
        let screen = Screen { view: &view, notice: hostile, scroll: 0 };
        terminal.draw(|frame| frame.render_widget(screen, frame.area())).unwrap();
        let drawn = terminal.backend().to_string();
        // The column of processes has no room for the end.
        assert_eq!(drawn.matches("a\\u{1b}[2J\\u{202e}").count(), 4, "{drawn}");
    }

    #[test]
    fn what_does_not_fit_is_scrolled_to() {
        let shows = |lines: &[String], text: &str| lines.iter().any(|line| line.starts_with(text));
        let (top, bottom) = (drawn(&view(40), (80, 24), 0), drawn(&view(40), (80, 24), 1000));
        for (first, last) in [("process-0 ", "process-39 "), ("/process-0/", "/process-39/")] {
            assert!(shows(&top, first) && !shows(&top, last), "{top:#?}");
            assert!(!shows(&bottom, first) && shows(&bottom, last), "{bottom:#?}");
        }
    }

    #[test]
    fn a_terminal_of_any_size_is_drawn_into() {
        for size in [(1, 1), (3, 2), (20, 5), (80, 6), (200, 60)] {
            drawn(&view(8), size, 3);
        }
    }
}
