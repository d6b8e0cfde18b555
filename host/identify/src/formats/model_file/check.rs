//! Checks a model beyond its types: finite numbers, the leg's names, a valid covariance.
//!
//! The covariance was computed in single precision. Rounding may therefore make the smallest
//! eigenvalue of its correlations slightly negative.

use scarab::model::{PARAMETERS_PER_JOINT, Parameter};
use scarab_base::names::{asymmetry_name, parameter_name};
use scarab_base::toml_file::{Fault, Step};

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::fingerprint;
use crate::formats::model_file::{
    BaseSet, LARGEST_BASE_SET, ModelFile, StoredBase, StoredParameter, padded, parameter_of,
};
use crate::formats::temperature::RANGE_C;

/// Smallest eigenvalue of the correlations.
const SMALLEST_EIGENVALUE: f64 = -1e-5;
/// Relative tolerance between redundant numbers, for rounding.
const ROUNDING: f64 = 1e-5;
const STATUS: [&str; 4] = ["identified", "grouped", "weak", "prior"];

type Checked = Result<(), Fault>;

fn fault(steps: &[Step], reason: impl Into<String>) -> Fault {
    Fault { steps: steps.to_vec(), reason: reason.into() }
}

pub(super) fn model(model: &ModelFile) -> Checked {
    leg(model)?;
    let conditions = |key| [Step::Key("conditions"), Step::Key(key)];
    if model.created.parse::<jiff::Timestamp>().is_err() {
        return Err(fault(&[Step::Key("created")], format!("`{}` is not a time", model.created)));
    }
    for (key, value) in
        [("bandwidth_hz", model.conditions.bandwidth_hz), ("motion_s", model.conditions.motion_s)]
    {
        if !(value > 0.0 && value.is_finite()) {
            return Err(fault(&conditions(key), format!("`{key}` is {value}; it must be above 0")));
        }
    }
    let (low, high) = RANGE_C;
    if let Some(celsius) = model.conditions.temperature_c.filter(|celsius| !(low..=high).contains(celsius)) {
        let reason = format!("`temperature_c` is {celsius}, outside {low}..{high}");
        return Err(fault(&conditions("temperature_c"), reason));
    }
    if !["relative", "absolute"].contains(&model.conditions.scale.as_str()) {
        let reason = format!("`scale` is `{}`, neither relative nor absolute", model.conditions.scale);
        return Err(fault(&conditions("scale"), reason));
    }
    for name in &model.conditions.not_estimated {
        known(model, name, &conditions("not_estimated"))?;
    }
    for (number, fit) in model.conditions.fits.iter().enumerate() {
        let steps = [Step::Key("conditions"), Step::Key("fits"), Step::Entry(number)];
        let numbers = [fit.rms_nm, fit.percent_of_mean_abs];
        if numbers.iter().flatten().chain(&model.conditions.condition).any(|value| !(*value >= 0.0)) {
            return Err(fault(&steps, "an error must be finite and not negative"));
        }
    }
    base_set(model)?;
    full_set(model)
}

/// Checks the leg by the leg file's own bounds, and against the fingerprint.
fn leg(model: &ModelFile) -> Checked {
    let steps = [Step::Key("leg")];
    let leg = model.leg.to_leg_file();
    LegFile::parse(&leg.to_toml(), "leg").map_err(|error| fault(&steps, error.reason))?;
    let found = fingerprint(&leg).map_err(|error| fault(&steps, error.reason))?;
    if model.fingerprint != found {
        let reason = format!("`fingerprint` is {}, that of this leg is {found}", model.fingerprint);
        return Err(fault(&[Step::Key("fingerprint")], reason));
    }
    Ok(())
}

fn known(model: &ModelFile, name: &str, steps: &[Step]) -> Result<(usize, Parameter), Fault> {
    parameter_of(name, model.leg.joints.len())
        .ok_or_else(|| fault(steps, format!("`{name}` is not a parameter of this leg")))
}

fn base_set(model: &ModelFile) -> Checked {
    let set = &model.base_set;
    let path = |number| [Step::Key("base_set"), Step::Key("parameters"), Step::Entry(number)];
    if !(1..=LARGEST_BASE_SET).contains(&set.parameters.len()) {
        let reason = format!("{} base parameters; allowed are 1 to {LARGEST_BASE_SET}", set.parameters.len());
        return Err(fault(&path(0)[..2], reason));
    }
    for (number, base) in set.parameters.iter().enumerate() {
        let steps = path(number);
        let carrier = known(model, &base.carrier, &steps)?;
        if set.parameters[..number].iter().any(|other| model.parameter(&other.carrier) == Some(carrier)) {
            return Err(fault(&steps, format!("`{}` carries two base parameters", base.carrier)));
        }
        for (name, factor) in &base.terms {
            if !model.is_rest(name) {
                known(model, name, &steps)?;
            }
            if !factor.is_finite() {
                return Err(fault(&steps, format!("the factor of `{name}` is {factor}")));
            }
        }
        if base.terms.get(&base.carrier) != Some(&1.0) {
            return Err(fault(&steps, format!("`{}` must occur once in its own sum", base.carrier)));
        }
        if !base.value.is_finite() {
            return Err(fault(&steps, format!("`value` is {}", base.value)));
        }
        if !(base.sigma > 0.0 && base.sigma.is_finite()) {
            return Err(fault(&steps, format!("`sigma` is {}; it must be above 0", base.sigma)));
        }
    }
    for (number, found) in set.stribeck.iter().enumerate() {
        let steps = [Step::Key("base_set"), Step::Key("stribeck"), Step::Entry(number)];
        if !(1..=model.leg.joints.len()).contains(&found.joint) {
            return Err(fault(&steps, format!("joint {} does not exist", found.joint)));
        }
        if !(found.surplus_nm.is_finite() && found.speed_rad_s > 0.0 && found.speed_rad_s.is_finite()) {
            return Err(fault(&steps, "a surplus must be finite, a speed above 0"));
        }
        let sigmas = [found.surplus_sigma_nm, found.speed_sigma_rad_s];
        if let Some(sigma) = sigmas.into_iter().flatten().find(|sigma| !(*sigma >= 0.0 && sigma.is_finite()))
        {
            return Err(fault(&steps, format!("a standard deviation is {sigma}; it must be 0 or more")));
        }
    }
    for (number, torque) in set.additional_torque.iter().enumerate() {
        let steps = [Step::Key("base_set"), Step::Key("additional_torque"), Step::Entry(number)];
        if !(1..=model.leg.joints.len()).contains(&torque.joint) {
            return Err(fault(&steps, format!("joint {} does not exist", torque.joint)));
        }
        if !(torque.value.is_finite() && torque.sigma >= 0.0 && torque.sigma.is_finite()) {
            return Err(fault(&steps, "`value` must be finite, `sigma` 0 or more"));
        }
        let shift = &torque.shift;
        if !(shift.is_empty() || shift.len() == set.parameters.len())
            || shift.iter().any(|change| !change.is_finite())
        {
            return Err(fault(&steps, "`shift` must have one finite number for each base parameter"));
        }
    }
    covariance(set)
}

fn covariance(set: &BaseSet) -> Checked {
    let (rows, count) = (&set.covariance, set.parameters.len());
    let path = |row| [Step::Key("base_set"), Step::Key("covariance"), Step::Entry(row)];
    if rows.len() != count {
        let reason = format!("`covariance` has {} rows for {count} base parameters", rows.len());
        return Err(fault(&path(0)[..2], reason));
    }
    for (row, (elements, base)) in rows.iter().zip(&set.parameters).enumerate() {
        if elements.len() != count {
            let reason = format!("{} elements in a row for {count} base parameters", elements.len());
            return Err(fault(&path(row), reason));
        }
        if let Some(element) = elements.iter().find(|element| !element.is_finite()) {
            return Err(fault(&path(row), format!("an element of `covariance` is {element}")));
        }
        own_variance(elements[row], base).map_err(|reason| fault(&path(row), reason))?;
    }
    for row in 0..count {
        if let Some(column) = (0..row).find(|&column| rows[row][column] != rows[column][row]) {
            let (one, other) = (&set.parameters[column].name, &set.parameters[row].name);
            let reason =
                format!("`covariance` is not symmetric: {one} with {other} differs from the reverse");
            return Err(fault(&path(row), reason));
        }
    }
    let correlations =
        padded(count, |row, column| rows[row][column] / (rows[row][row] * rows[column][column]).sqrt());
    let smallest = correlations.symmetric_eigenvalues().min();
    if !(smallest >= SMALLEST_EIGENVALUE) {
        let reason = format!(
            "`covariance` is invalid: some sum of base parameters would have a negative variance (eigenvalue {smallest:.2e})"
        );
        return Err(fault(&path(0)[..2], reason));
    }
    Ok(())
}

fn own_variance(variance: f64, base: &StoredBase) -> Result<(), String> {
    if !(variance > 0.0) {
        return Err(format!("the variance of {} is {variance}; it must be above 0", base.name));
    }
    if (variance.sqrt() - base.sigma).abs() > ROUNDING * base.sigma {
        return Err(format!("the variance of {} is {variance}, not the square of its `sigma`", base.name));
    }
    Ok(())
}

fn full_set(model: &ModelFile) -> Checked {
    let path = |number| [Step::Key("full_set"), Step::Key("parameters"), Step::Entry(number)];
    let parameters = &model.full_set.parameters;
    let expected = model.leg.joints.len() * PARAMETERS_PER_JOINT;
    if parameters.len() != expected {
        let reason = format!("{} parameters, expected {expected}", parameters.len());
        return Err(fault(&path(0)[..2], reason));
    }
    for (number, parameter) in parameters.iter().enumerate() {
        let (joint, symbol) = (number / PARAMETERS_PER_JOINT, Parameter::ALL[number % PARAMETERS_PER_JOINT]);
        let plain = parameter_name(joint, symbol);
        let other = (symbol == Parameter::OFF).then(|| asymmetry_name(joint));
        let name = other.filter(|other| *other == parameter.name).unwrap_or(plain);
        one_parameter(parameter, &name, symbol).map_err(|reason| fault(&path(number), reason))?;
    }
    Ok(())
}

fn one_parameter(parameter: &StoredParameter, name: &str, symbol: Parameter) -> Result<(), String> {
    if parameter.name != name {
        return Err(format!("`{}` instead of `{name}`", parameter.name));
    }
    if parameter.unit != symbol.unit() {
        return Err(format!("{name} in `{}` instead of {}", parameter.unit, symbol.unit()));
    }
    if let Some(value) = parameter.value.filter(|value| !value.is_finite()) {
        return Err(format!("`value` of {name} is {value}"));
    }
    if let Some(sigma) = parameter.sigma.filter(|sigma| !(*sigma >= 0.0 && sigma.is_finite())) {
        return Err(format!("`sigma` of {name} is {sigma}; it must not be negative"));
    }
    if !STATUS.contains(&parameter.status.as_str()) {
        return Err(format!(
            "`status` of {name} is `{}`, not one of {}",
            parameter.status,
            STATUS.join(", ")
        ));
    }
    Ok(())
}
