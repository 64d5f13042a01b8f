//! Finds the device that the setting `audio.input` selects. In: the setting and the devices of the
//! system. Out: a device, or the reason why there is none.

use cpal::Device;
use cpal::traits::HostTrait;

use super::candidates::{Candidate, candidates, default_loopback};
use super::services::{Service, preferred, services};
use super::{DEFAULT, DeviceError, DeviceName, JACK, OUTPUT, OUTPUT_PREFIX, silence_libraries};

/// Returns true if the setting `audio.input` has the value `name` and selects what an output device
/// plays.
pub fn is_loopback(name: &str) -> bool {
    name.eq_ignore_ascii_case(OUTPUT) || output_name(name).is_some()
}

/// Returns the name after [`OUTPUT_PREFIX`]; `None` if `name` has another start.
fn output_name(name: &str) -> Option<&str> {
    let (prefix, rest) = name.split_at_checked(OUTPUT_PREFIX.len())?;
    prefix.eq_ignore_ascii_case(OUTPUT_PREFIX).then_some(rest)
}

/// Returns the device that `name` selects: [`DEFAULT`], [`JACK`], [`OUTPUT`], the name or id of a
/// device, or a part of a name or id that only one device has. After [`OUTPUT_PREFIX`], it is the
/// name or id of an output device. `before` is the device that `name` selected last time; only this
/// device is then accepted. [`DEFAULT`], [`JACK`] and [`OUTPUT`] ignore `before`.
///
/// If several audio services have such a device, the device of the preferred service is returned.
///
/// # Errors
/// [`DeviceError::NoSuch`], [`DeviceError::NoJack`], [`DeviceError::NoLoopback`] or
/// [`DeviceError::NoDefault`] if there is no such device, [`DeviceError::Ambiguous`] if an audio
/// service has several.
pub fn find_input(name: &str, before: Option<&DeviceName>) -> Result<Device, DeviceError> {
    silence_libraries();
    find_among(&services(), name, before)
}

/// Returns the device of one of `services` that `name` selects; the other parameter and the errors
/// are those of [`find_input`].
///
/// # Errors
/// See [`find_input`].
pub fn find_among(
    services: &[Service],
    name: &str,
    before: Option<&DeviceName>,
) -> Result<Device, DeviceError> {
    if name.eq_ignore_ascii_case(DEFAULT) {
        let none = |reason| DeviceError::NoDefault {
            direction: "input",
            reason,
        };
        return preferred(services)
            .map_err(|error| none(error.to_string()))?
            .default_input_device()
            .ok_or_else(|| none("the system has none".into()));
    }
    if name.eq_ignore_ascii_case(JACK) {
        let jack = services.iter().find(|service| service.is(JACK));
        return jack
            .and_then(|jack| jack.host().ok()?.default_input_device())
            .ok_or(DeviceError::NoJack);
    }
    if name.eq_ignore_ascii_case(OUTPUT) {
        return services
            .iter()
            .find_map(default_loopback)
            .ok_or(DeviceError::NoLoopback);
    }
    find_by_name(services, name, before)
}

/// Returns the device whose name or id is or contains `name`; the parameters and errors are those
/// of [`find_among`].
fn find_by_name(
    services: &[Service],
    name: &str,
    before: Option<&DeviceName>,
) -> Result<Device, DeviceError> {
    let (wanted, is_loopback) = match output_name(name) {
        Some(output) => (output, true),
        None => (name, false),
    };
    let mut found: Vec<Vec<Candidate>> = services
        .iter()
        .filter_map(|service| candidates(service).ok())
        .map(|mut found| {
            found.retain(|candidate| candidate.is_loopback == is_loopback);
            found
        })
        .collect();
    let names: Vec<Vec<DeviceName>> = found
        .iter()
        .map(|found| found.iter().map(|one| one.name.clone()).collect())
        .collect();
    let (service, device) = choose(name, wanted, before, &names)?;
    Ok(found[service].swap_remove(device).device)
}

/// Searches the names of the devices of each audio service, the preferred service first, and returns
/// the index of the service and of the device. `setting` is the value of `audio.input`; `wanted` is
/// the part of it that names the device.
///
/// # Errors
/// [`DeviceError::NoSuch`] or [`DeviceError::Ambiguous`].
pub(super) fn choose(
    setting: &str,
    wanted: &str,
    before: Option<&DeviceName>,
    services: &[Vec<DeviceName>],
) -> Result<(usize, usize), DeviceError> {
    for (service, names) in services.iter().enumerate() {
        let found = match before {
            Some(before) => find_again(before, names),
            None => resolve(wanted, names),
        };
        match found {
            Ok(device) => return Ok((service, device)),
            Err(DeviceError::NoSuch { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let all = services.concat();
    Err(DeviceError::NoSuch {
        name: before.map_or(setting, |before| &before.name).into(),
        available: descriptions(&all, &(0..all.len()).collect::<Vec<_>>()),
    })
}

/// Returns the reason why the input device `name` is not available now; `None` if it is available
/// or if `name` is [`DEFAULT`].
pub fn missing(name: &str) -> Option<DeviceError> {
    if name.eq_ignore_ascii_case(DEFAULT) {
        None
    } else {
        find_input(name, None).err()
    }
}

/// Searches `all` for the device `before` and returns its index. A device with the same name and id
/// is preferred. Otherwise the only device with the same name and the same kind of id (the part
/// before the colon) is accepted, because the rest of the id can change when the device is
/// connected again.
///
/// # Errors
/// [`DeviceError::NoSuch`] or [`DeviceError::Ambiguous`].
pub(super) fn find_again(before: &DeviceName, all: &[DeviceName]) -> Result<usize, DeviceError> {
    let DeviceName { name, id } = before;
    let same_id = all.iter().position(|device| device == before);
    let kind = |id: &str| id.split(':').next().unwrap_or_default().to_owned();
    let same_name: Vec<usize> = (0..all.len())
        .filter(|&i| all[i].name == *name && kind(&all[i].id) == kind(id))
        .collect();
    match (same_id, &same_name[..]) {
        (Some(i), _) => Ok(i),
        (None, &[i]) => Ok(i),
        (None, []) => Err(DeviceError::NoSuch {
            name: name.clone(),
            available: descriptions(all, &(0..all.len()).collect::<Vec<_>>()),
        }),
        (None, several) => Err(DeviceError::Ambiguous {
            name: name.clone(),
            matches: descriptions(all, several),
        }),
    }
}

/// Searches `all` for the device that `wanted` names and returns its index; upper and lower case
/// are the same. A name or id equal to `wanted` is preferred to one that contains `wanted`. ALSA's
/// several ids of one device are treated as one device.
///
/// # Errors
/// [`DeviceError::NoSuch`] or [`DeviceError::Ambiguous`].
pub(super) fn resolve(wanted: &str, all: &[DeviceName]) -> Result<usize, DeviceError> {
    if let Some(i) = all.iter().position(|device| device.id == wanted) {
        return Ok(i);
    }
    let part = wanted.to_lowercase();
    let matching = |whole: bool| -> Vec<usize> {
        let fits = |text: &str| {
            if whole {
                text.to_lowercase() == part
            } else {
                text.to_lowercase().contains(&part)
            }
        };
        (0..all.len())
            .filter(|&i| fits(&all[i].name) || fits(&all[i].id))
            .collect()
    };
    let mut matches = matching(true);
    if matches.is_empty() && !part.is_empty() {
        matches = matching(false);
    }
    // ALSA has several ids for one device; an id that converts formats is the easiest to open.
    let rank = |i: usize| {
        ["plughw:", "sysdefault:"]
            .iter()
            .position(|prefix| all[i].id.starts_with(prefix))
            .unwrap_or(2)
    };
    let Some(best) = matches.iter().copied().min_by_key(|&i| rank(i)) else {
        return Err(DeviceError::NoSuch {
            name: wanted.into(),
            available: descriptions(all, &(0..all.len()).collect::<Vec<_>>()),
        });
    };
    let is_other =
        |i: usize| all[i].name != all[best].name || hardware(&all[i]) != hardware(&all[best]);
    if matches.iter().any(|&i| is_other(i)) {
        return Err(DeviceError::Ambiguous {
            name: wanted.into(),
            matches: descriptions(all, &matches),
        });
    }
    Ok(best)
}

/// Returns the part of the id of `device` that differs between two devices of the same name: the
/// sound card in an id of ALSA, such as `CARD=USB`, otherwise the whole id.
fn hardware(device: &DeviceName) -> &str {
    let parts = device.id.split([':', ',']);
    let mut cards = parts.filter(|part| part.starts_with("CARD="));
    cards.next().unwrap_or(&device.id)
}

/// Returns the names and ids of the devices in `all` with the indices `which`, as text for the
/// user.
fn descriptions(all: &[DeviceName], which: &[usize]) -> Vec<String> {
    which
        .iter()
        .map(|&i| {
            if all[i].name == all[i].id {
                all[i].name.clone()
            } else {
                all[i].to_string()
            }
        })
        .collect()
}
