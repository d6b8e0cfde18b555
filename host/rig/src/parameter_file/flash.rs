//! Reads a file from a flash image, and writes one into it.

use embassy_futures::block_on;
use scarab::leg::DriveState;
use scarab::store::{
    CalibrationRecord, Key, LoadError, ModelRecord, Permit, RecordError, SaveError, Saved, Storable, Store,
};

use crate::parameter_file::memory::{Cells, Memory};
use crate::parameter_file::{
    AxisCalibration, Joint, ModelPart, NodeObjects, PARAMETER_SCHEMA, ParameterFile, objects, of_node,
};

const OBJECTS: [(Joint, Key); 2] = [(Joint::Hip, Key::Objects1), (Joint::Knee, Key::Objects2)];
const CALIBRATIONS: [(Joint, Key); 2] = [(Joint::Hip, Key::Calibration1), (Joint::Knee, Key::Calibration2)];
/// Name of each model in messages, and its key.
const MODELS: [(&str, Key); 2] = [("model", Key::Model), ("model of the worn leg", Key::WornModel)];
const LONGEST: usize = 402;

/// Contents of a flash.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlashContents {
    /// All readable and valid data.
    pub file: ParameterFile,
    /// Parts that were never stored, or have been erased.
    pub absent: Vec<String>,
    /// Rejected parts, and why.
    pub damaged: Vec<String>,
}

fn load_words(why: LoadError) -> String {
    match why {
        LoadError::Damaged => "the flash contains foreign data, or is damaged beyond repair".into(),
        LoadError::Flash => "the flash cannot be read".into(),
        LoadError::Record(RecordError::Length) => "the record has another length than its schema".into(),
        LoadError::Record(RecordError::Newer { schema }) => {
            format!("the record has the unknown schema {schema}")
        }
        LoadError::Record(RecordError::Range) => "a value of the record is outside its range".into(),
    }
}

impl FlashContents {
    /// Records the state of a part; returns the part if valid.
    fn note<T>(&mut self, what: &str, part: Result<Option<T>, String>) -> Option<T> {
        match part {
            Ok(Some(part)) => return Some(part),
            Ok(None) => self.absent.push(what.to_owned()),
            Err(why) => self.damaged.push(format!("{what}: {why}")),
        }
        None
    }
}

fn load<R: Storable>(memory: &mut Memory, key: Key) -> Result<Option<R>, LoadError> {
    memory.with(|store| block_on(store.load::<R>(key))).unwrap_or(Err(LoadError::Flash))
}

fn model<const N: usize>(memory: &mut Memory, key: Key) -> Result<Option<ModelPart>, LoadError> {
    Ok(load::<ModelRecord<N>>(memory, key)?.map(|kept| ModelPart::from_record(&kept)))
}

/// Model with as many joints as the length of its record.
fn any_model(memory: &mut Memory, key: Key) -> Result<Option<ModelPart>, String> {
    let other = |found| found == Err(LoadError::Record(RecordError::Length));
    let mut found = model::<2>(memory, key);
    for of_another in [model::<1>, model::<3>] {
        if other(found.clone()) {
            found = of_another(memory, key);
        }
    }
    let found = found.map_err(load_words)?;
    found.map(|part| part.check(key).map(|()| part)).transpose()
}

fn node(memory: &mut Memory, joint: Joint, key: Key) -> Result<Option<NodeObjects>, String> {
    let mut bytes = [0; LONGEST];
    let length = memory.with(|store| block_on(store.load_bytes(key, &mut bytes)));
    let Some(length) = length.unwrap_or(Err(LoadError::Flash)).map_err(load_words)? else { return Ok(None) };
    let objects = objects::of_bytes(&bytes[..length], joint)?;
    Ok(Some(NodeObjects { joint, objects }))
}

fn calibration(memory: &mut Memory, joint: Joint, key: Key) -> Result<Option<AxisCalibration>, String> {
    let kept = load::<CalibrationRecord>(memory, key).map_err(load_words)?;
    kept.map(|kept| {
        let part = AxisCalibration::from_record(joint, &kept);
        part.to_record().map(|_| part)
    })
    .transpose()
}

/// Describes a failed save.
fn saved(done: Option<Result<Saved, SaveError>>, what: &str) -> Result<(), String> {
    match done {
        Some(Ok(_)) => Ok(()),
        Some(Err(SaveError::Damaged)) => Err(format!(
            "{what}: the flash contains foreign data, or is damaged beyond repair: nothing was written"
        )),
        Some(Err(why)) => Err(format!("{what}: not stored ({why:?}): nothing was written")),
        None => Err(format!("{what}: the flash cannot be read: nothing was written")),
    }
}

/// Reason why a flash does not belong to the store and must not be written. The store itself would treat it
/// as an interrupted write, and erase it as a repair.
fn foreign(memory: &Memory) -> Option<String> {
    let mut readable = memory.clone().bytes().iter().all(|byte| *byte == 0xFF);
    for key in Key::ALL {
        let load = |store: &mut Store<Cells>| {
            block_on(store.load_bytes(key, &mut [0; LONGEST])).map(|length| length.is_some())
        };
        match memory.clone().with(load).unwrap_or(Err(LoadError::Flash)) {
            Ok(there) => readable |= there,
            Err(LoadError::Record(_)) => readable = true,
            Err(why) => return Some(load_words(why)),
        }
    }
    (!readable).then(|| "the flash is not empty, but no record in it can be read".into())
}

impl ParameterFile {
    /// Contents of a board's flash. Each part is read from a copy, so repairs by the store neither hide
    /// another part nor are written.
    pub fn from_flash(memory: &Memory) -> FlashContents {
        let mut found = FlashContents {
            file: Self { schema: PARAMETER_SCHEMA, ..Self::default() },
            ..FlashContents::default()
        };
        for (joint, key) in OBJECTS {
            let part = node(&mut memory.clone(), joint, key);
            let part = found.note(&format!("objects of the {}", joint.name()), part);
            found.file.node.extend(part);
        }
        for (joint, key) in CALIBRATIONS {
            let part = calibration(&mut memory.clone(), joint, key);
            let part = found.note(&format!("calibration of the {}", joint.name()), part);
            found.file.calibration.extend(part);
        }
        let [model, worn_model] = MODELS.map(|(what, key)| {
            let part = any_model(&mut memory.clone(), key);
            found.note(what, part)
        });
        (found.file.model, found.file.worn_model) = (model, worn_model);
        if found.absent.len() == Key::ALL.len() {
            found.damaged.extend(foreign(memory));
        }
        found
    }

    /// Stores every part that the file names. If this fails, discard the image.
    ///
    /// # Errors
    /// Describes what cannot be stored, and why.
    pub fn write_into(&self, memory: &mut Memory) -> Result<(), String> {
        if let Some(why) = foreign(memory) {
            return Err(format!("{why}: nothing was written"));
        }
        let permit = Permit::from_state(DriveState::SwitchOnDisabled).ok_or("a drive that is off")?;
        for (joint, key) in CALIBRATIONS {
            let given = |joint| self.calibration.iter().any(|axis| axis.joint == joint);
            let other_is_older =
                !given(joint) && matches!(load::<CalibrationRecord>(memory, key), Ok(Some(_)));
            if !self.calibration.is_empty() && other_is_older {
                let name = joint.name();
                return Err(format!(
                    "calibration: the {name} has an older one, and one axis' new calibration must not be mixed with it: nothing was written"
                ));
            }
        }
        for (joint, key) in OBJECTS {
            for part in self.node.iter().filter(|node| node.joint == joint) {
                let what = format!("objects of the {}", joint.name());
                let bytes = objects::to_bytes(&part.objects, joint).map_err(|why| of_node(joint, &why))?;
                saved(memory.with(|store| block_on(store.save_bytes(&permit, key, &bytes))), &what)?;
            }
        }
        for (joint, key) in CALIBRATIONS {
            for part in self.calibration.iter().filter(|axis| axis.joint == joint) {
                let kept = part.to_record()?;
                let what = format!("calibration of the {}", joint.name());
                saved(memory.with(|store| block_on(store.save(&permit, key, &kept))), &what)?;
            }
        }
        for ((what, _), model) in MODELS.into_iter().zip([&self.model, &self.worn_model]) {
            let Some(model) = model else { continue };
            match model.joint.len() {
                1 => keep_model(memory, &permit, &model.to_record::<1>()?, what)?,
                3 => keep_model(memory, &permit, &model.to_record::<3>()?, what)?,
                _ => keep_model(memory, &permit, &model.to_record::<2>()?, what)?,
            }
        }
        Ok(())
    }
}

fn keep_model<const N: usize>(
    memory: &mut Memory,
    permit: &Permit,
    kept: &ModelRecord<N>,
    what: &str,
) -> Result<(), String> {
    let save = |store: &mut Store<Cells>| block_on(store.save(permit, kept.key(), kept));
    saved(memory.with(save), what)
}
