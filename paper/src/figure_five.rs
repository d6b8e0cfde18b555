//! Figure 5: paths of the swarms on f1 to f4 in the plane.
//!
//! For each function the paper shows the trace of the best beetle, its path over the contour map,
//! and convergence over iterations. Reproduced here for the swarm as printed and for the default
//! one. Convergence over evaluations is added, since iterations of different searches cost
//! differently. Paths and traces are those of the first run; curves are the median of all runs with
//! the interquartile range. Drawing: `figures::swarm`.

use scarab::swarm::{
    Bas, BasSettings, Bso, BsoSettings, Pso, PsoSettings, Search, SwarmError, TestFunction, TestProblem,
};
use scarab_base::error::ToolError;
use serde_json::Map;

use super::contenders::{Algorithm, SWARM};
use super::seeds::ReportSeed;
use super::{PaperOptions, Part, Section, table_three};
use crate::figures::swarm::{self, Band, Convergence, Walk};

/// Runs of each search by default.
const RUNS: u64 = 101;
/// Iterations drawn.
const ITERATIONS: usize = 60;
/// Evaluations drawn.
const EVALUATIONS: usize = 1_500;

const FUNCTIONS: [(&str, &str, TestFunction); 4] = [
    ("f1", "sphere", TestFunction::Sphere),
    ("f2", "six-hump camel", TestFunction::SixHumpCamel),
    ("f3", "Branin", TestFunction::Branin),
    ("f4", "Ackley", TestFunction::Ackley),
];

const SEARCHES: [Algorithm; 4] = [Algorithm::Pso, Algorithm::Bas, Algorithm::BsoPaper, Algorithm::Bso];

/// Course of one run.
struct Way {
    /// Best position after every iteration, beginning with the scattered swarm's.
    positions: Vec<[f64; 2]>,
    /// f - f* at these positions.
    by_iteration: Vec<f64>,
    /// f - f* of the best after every evaluation.
    by_evaluation: Vec<f64>,
}

/// Draws the four figures.
pub fn section(options: &PaperOptions) -> Result<Section, ToolError> {
    let runs = options.runs(RUNS);
    let mut figures = Vec::new();
    let mut markdown = format!(
        "Paths and traces of the first of {runs} runs; curves are medians with the middle half of the runs.\n"
    );
    for (id, name, function) in FUNCTIONS {
        let problem = TestProblem::new(function, 2);
        let file = format!("figure-5-{id}.svg");
        let title =
            format!("{id}, {name}: the best beetle's path, its trace and the convergence of four searches");
        let mut walks = Vec::new();
        let mut convergence = Vec::new();
        for search in SEARCHES {
            let ways = (0..runs)
                .map(|run| way(search, &problem, ReportSeed::from_run(run)))
                .collect::<Result<Vec<_>, _>>()
                .map_err(|error| ToolError::input(format!("{id} {}: {error:?}", search.id())))?;
            let curves = |curve: fn(&Way) -> &[f64]| ways.iter().map(curve).collect::<Vec<_>>();
            convergence.push(Convergence {
                name: search.id(),
                by_iteration: Band::over_iterations(&curves(|way| &way.by_iteration)),
                by_evaluation: Band::over_evaluations(&curves(|way| &way.by_evaluation)),
            });
            if let (Algorithm::BsoPaper | Algorithm::Bso, Some(first)) = (search, ways.into_iter().next()) {
                walks.push(Walk { name: search.id(), positions: first.positions });
            }
        }
        figures.push(swarm::figure(
            file.clone(),
            &title,
            &problem,
            &table_three::minimisers(&problem),
            &walks,
            &convergence,
        )?);
        markdown.push_str(&format!("\n![{title}](../figures/paper/{file})\n"));
    }
    Ok(Section { name: Part::FigureFive.section_name(), markdown, figures, json: Map::new() })
}

fn way(algorithm: Algorithm, problem: &TestProblem, seed: ReportSeed) -> Result<Way, SwarmError> {
    const N: usize = SWARM as usize;
    let seed = seed.search();
    Ok(match algorithm {
        Algorithm::Bas => walk(Bas::<f64, 2>::new(problem, BasSettings::default(), seed)?, problem, 1),
        Algorithm::BsoPaper => walk(Bso::<f64, N, 2>::new(problem, BsoSettings::paper(), seed)?, problem, N),
        Algorithm::Bso => walk(Bso::<f64, N, 2>::new(problem, BsoSettings::default(), seed)?, problem, N),
        _ => walk(Pso::<f64, N, 2>::new(problem, PsoSettings::default(), seed)?, problem, N),
    })
}

/// Drives a search by single evaluations; the first `first` belong to iteration 0.
fn walk(mut search: impl Search<f64>, problem: &TestProblem, first: usize) -> Way {
    let mut way = Way { positions: Vec::new(), by_iteration: Vec::new(), by_evaluation: Vec::new() };
    while way.by_iteration.len() <= ITERATIONS || way.by_evaluation.len() < EVALUATIONS {
        let before = search.iterations();
        if search.advance(problem, 1) == 0 {
            break;
        }
        let Some(best) = search.best() else { continue };
        let excess = best.value - problem.minimum();
        way.by_evaluation.push(excess);
        if way.by_evaluation.len() == first || search.iterations() > before {
            way.by_iteration.push(excess);
            if let [x, y] = *best.position {
                way.positions.push([x, y]);
            }
        }
    }
    way.by_iteration.truncate(ITERATIONS + 1);
    way.positions.truncate(ITERATIONS + 1);
    way.by_evaluation.truncate(EVALUATIONS);
    way
}
