//! Table III: the paper's four functions, as intended and as printed, and the positions of their
//! least values.
//!
//! Why: success in Table IV is the distance to the least value, and the paper's list of these
//! values is wrong. They are searched for here, independently of `TestProblem::minimum`. A grid
//! over the box is followed by a compass search from the best points of the grid (Hooke, Jeeves,
//! 1961, without its pattern moves).
//!
//! Cost: 4 million evaluations of functions of the plane, a fraction of a second. Known limits: a
//! minimum narrower than the grid's spacing of 1/1000 of the box could hide between its points.

use scarab::swarm::{Objective, TestFunction, TestProblem};
use scarab_base::error::ToolError;
use scarab_base::table::Table;
use serde::Serialize;

use super::{Part, Section};

/// Points of the grid along each axis.
const GRID_POINTS: u32 = 1001;
/// Points of the coarser grid on which the paper's least value of Branin's function is found.
const COARSE_GRID_POINTS: u32 = 51;
/// Grid points from which the compass search starts.
const STARTS: usize = 12;
/// Tolerance between a stated and a found least value, relative to 1 + |value|: a double's rounding
/// of an exact zero.
const AGREEMENT: f64 = 1e-9;

/// A function of Table III in one reading.
struct Entry {
    id: &'static str,
    reading: &'static str,
    function: TestFunction,
    formula: &'static str,
    /// Value listed in the paper's Table III.
    listed: f64,
}

const ENTRIES: [Entry; 7] = [
    Entry {
        id: "f1",
        reading: "intended",
        function: TestFunction::Sphere,
        formula: "x^2 + y^2",
        listed: 0.0,
    },
    Entry {
        id: "f2",
        reading: "intended",
        function: TestFunction::SixHumpCamel,
        formula: "(4 - 2.1 x^2 + x^4 / 3) x^2 + x y + (4 y^2 - 4) y^2",
        listed: -0.873,
    },
    Entry {
        id: "f2",
        reading: "printed",
        function: TestFunction::CamelAsPrinted,
        formula: "(4 - 2 x^2 + x^(4/3)) x^2 + x y + (4 y^2 - 4) y^2",
        listed: -0.873,
    },
    Entry {
        id: "f3",
        reading: "intended",
        function: TestFunction::Branin,
        formula: "(y - 5.1 / (4 pi^2) x^2 + 5 / pi x - 6)^2 + 10 (1 - 1 / (8 pi)) cos x + 10",
        listed: 0.415,
    },
    Entry {
        id: "f3",
        reading: "printed",
        function: TestFunction::BraninAsPrinted,
        formula: "x and y exchanged, 5 for 5.1",
        listed: 0.415,
    },
    Entry {
        id: "f4",
        reading: "intended",
        function: TestFunction::Ackley,
        formula: "20 + e - 20 exp(-0.2 sqrt(mean x_i^2)) - exp(mean cos 2 pi x_i)",
        listed: 0.0,
    },
    Entry {
        id: "f4",
        reading: "printed",
        function: TestFunction::AckleyAsPrinted,
        formula: "the same without + e",
        listed: 0.0,
    },
];

/// Results for one function, as written to the JSON report.
#[derive(Clone, Debug, Serialize)]
struct Found {
    function: &'static str,
    reading: &'static str,
    half_width: f64,
    minimum_listed: f64,
    minimum: f64,
    minimiser: [f64; 2],
    /// Least value on a grid of 51 x 51 points over the box.
    coarse_grid_minimum: f64,
}

/// Table, text and JSON of this part.
pub fn section() -> Result<Section, ToolError> {
    let found = ENTRIES.iter().map(find).collect::<Result<Vec<_>, _>>()?;
    let mut table = Table::default().label("function, D = 2").numbers([
        "box",
        "f_min listed",
        "found",
        "at x",
        "y",
        "on 51 x 51 points",
    ]);
    for (entry, found) in ENTRIES.iter().zip(&found) {
        let reading = if entry.reading == "printed" { " as printed" } else { "" };
        let [x, y] = found.minimiser;
        table.row([
            format!("{}{reading}: {}", entry.id, entry.formula),
            format!("{}", found.half_width),
            format!("{}", entry.listed),
            decimals(found.minimum, 6),
            decimals(x, 4),
            decimals(y, 4),
            decimals(found.coarse_grid_minimum, 4),
        ]);
    }
    let markdown = format!(
        "{}\nLeast values by a grid of {GRID_POINTS} x {GRID_POINTS} points and a compass search from \
         its best {STARTS}; the box is plus and minus the number given.\n",
        table.to_markdown()
    );
    Section::new(Part::TableThree, "minima", &found, markdown, Vec::new())
}

/// Formats a number with `digits` decimals; zero has no sign.
fn decimals(value: f64, digits: i32) -> String {
    let unit = 10_f64.powi(digits);
    format!("{:.*}", digits as usize, (value * unit).round() / unit + 0.0)
}

/// Searches one function's box and compares the result with the firmware's table.
fn find(entry: &Entry) -> Result<Found, ToolError> {
    let problem = TestProblem::new(entry.function, 2);
    let half = problem.half_width();
    let (minimum, minimiser) = descents(&problem)
        .into_iter()
        .min_by(|one, other| one.0.total_cmp(&other.0))
        .ok_or_else(|| ToolError::input("a grid without points"))?;
    if (minimum - problem.minimum()).abs() > AGREEMENT * (1.0 + minimum.abs()) {
        return Err(ToolError::input(format!(
            "{} {}: least value {minimum} found, {} stated",
            entry.id,
            entry.reading,
            problem.minimum()
        )));
    }
    let coarse_grid_minimum =
        grid(&problem, COARSE_GRID_POINTS).iter().map(|(value, _)| *value).fold(f64::INFINITY, f64::min);
    Ok(Found {
        function: entry.id,
        reading: entry.reading,
        half_width: half,
        minimum_listed: entry.listed,
        minimum,
        minimiser,
        coarse_grid_minimum,
    })
}

/// All distinct positions of the least value.
pub fn minimisers(problem: &TestProblem) -> Vec<[f64; 2]> {
    let near = |one: &[f64; 2], other: &[f64; 2]| {
        (one[0] - other[0]).hypot(one[1] - other[1]) < 1e-3 * problem.half_width()
    };
    let mut found: Vec<[f64; 2]> = Vec::new();
    for (value, position) in descents(problem) {
        let is_least = (value - problem.minimum()).abs() <= AGREEMENT * (1.0 + value.abs());
        if is_least && !found.iter().any(|known| near(known, &position)) {
            found.push(position);
        }
    }
    found
}

/// End points of the compass searches from the best points of the grid.
fn descents(problem: &TestProblem) -> Vec<Point> {
    let mut points = grid(problem, GRID_POINTS);
    points.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
    let spacing = 2.0 * problem.half_width() / f64::from(GRID_POINTS - 1);
    points.iter().take(STARTS).map(|start| compass(problem, *start, spacing)).collect()
}

/// Value and its position.
type Point = (f64, [f64; 2]);

fn grid(problem: &TestProblem, points: u32) -> Vec<Point> {
    let half = problem.half_width();
    let at = |index: u32| half * (2.0 * f64::from(index) / f64::from(points - 1) - 1.0);
    let point = |row: u32, column: u32| [at(column), at(row)];
    (0..points)
        .flat_map(|row| (0..points).map(move |column| point(row, column)))
        .map(|position| (problem.evaluate(&position), position))
        .collect()
}

/// Compass search: steps along the axes while the value falls, halves the step otherwise, down to rounding.
fn compass(problem: &TestProblem, start: Point, mut step: f64) -> Point {
    let half = problem.half_width();
    let mut best = start;
    while step > 1e-12 * half {
        let neighbours = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]].map(|[dx, dy]| {
            let [x, y] = best.1;
            let position = [(x + dx).clamp(-half, half), (y + dy).clamp(-half, half)];
            (problem.evaluate(&position), position)
        });
        let lowest = neighbours.into_iter().min_by(|one, other| one.0.total_cmp(&other.0));
        match lowest {
            Some(lowest) if lowest.0 < best.0 => best = lowest,
            _ => step /= 2.0,
        }
    }
    best
}
