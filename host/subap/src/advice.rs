//! Advice on errors: options that would help. The library reports causes, numbers and remedies; this module translates remedies into
//! options of the command line.

use std::error::Error;
use std::io;

use subaperture::describe::{DescriptionError, RenderedFault};
use subaperture::focus::plan::PlanError as ImagePlanError;
use subaperture::focus::{FormError, Remedy};
use subaperture::images::OpenError;
use subaperture::io::atomic::WriteError;
use subaperture::io::product::ReadError as ProductError;
use subaperture::io::tiles::StoreError;
use subaperture::io::{cphd, recording};
use subaperture::module::link::{LinkError, UnnamedFirmware};
use subaperture::module::plan::PlanError as ModulePlanError;
use subaperture::phase_history::ReadError;
use subaperture::planner::PlanError as RadarPlanError;
use subaperture::plot::PlotError;
use subaperture::resolution::survey::NoDefaultGrid;

/// Name of the memory user that `--check` adds.
pub(crate) const CHECK: &str = "--check";

/// Example of a grid.
const SOME_GRID: &str = "give one, for example --grid x=-50:50:0.5,y=-50:50:0.5,z=0";

/// An error and its causes in one line, each with advice; a cause already contained in its parent's text is not repeated.
pub(crate) fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if line.is_empty() {
            line = text;
        } else if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
        let advice = of(cause).unwrap_or_default();
        if !line.contains(&advice) {
            line.push_str(&advice);
        }
    }
    line
}

/// Advice on an error and its causes, without the error text.
pub(crate) fn alone(error: &anyhow::Error) -> Option<String> {
    let advice = error.chain().find_map(of)?;
    Some(advice.trim_start_matches([':', ';', ' ', '\n']).to_owned())
}

/// Error text with advice.
pub(crate) fn with_advice(error: &(dyn Error + 'static)) -> String {
    format!("{error}{}", of(error).unwrap_or_default())
}

/// Advice on an error of image formation, as a continuation of its text.
pub(crate) fn after(error: &FormError) -> Option<String> {
    of_forming(error)
}

/// Advice on any error, as a continuation of its text.
fn of(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(inner) = inner(error) {
        return of(inner);
    }
    if let Some(error) = error.downcast_ref::<FormError>() {
        return match error {
            FormError::Device(_) => Some("; form the image with --device cpu".to_owned()),
            error => of_forming(error),
        };
    }
    match error.downcast_ref() {
        Some(ReadError::Memory { .. }) => return Some(": raise --memory".to_owned()),
        Some(ReadError::Description(error)) => return of(&**error),
        _ => {}
    }
    if error.is::<NoDefaultGrid>() {
        return Some(format!("; {SOME_GRID}"));
    }
    if let Some(WriteError::NotOurs { .. }) = error.downcast_ref() {
        return Some("; name another, or replace it with --force".to_owned());
    }
    if let Some(StoreError::Damaged { mark, .. }) = error.downcast_ref() {
        let mark = mark.display();
        return Some(format!(
            ": remove {mark} and form the image again with --resume"
        ));
    }
    if let Some(error) = error.downcast_ref::<DescriptionError>() {
        let wanted = error.faults.iter().any(RenderedFault::wants_memory);
        return wanted.then(|| "\nraise --memory to allow it more".to_owned());
    }
    if error.is::<UnnamedFirmware>() {
        return Some(" with --firmware".to_owned());
    }
    let advice = match error.downcast_ref::<ModulePlanError>()? {
        ModulePlanError::Bound { .. } => ": allow more with --error-db",
        ModulePlanError::Swept { .. } => {
            "; allow more with --error-db, give a smaller --grid, or use subap focus without a module"
        }
        ModulePlanError::Room { .. } => {
            "; allow a larger error with --error-db, give a smaller --grid, or more memory"
        }
        _ => return None,
    };
    Some(advice.to_owned())
}

/// Error that another one wraps transparently, without being its cause.
fn inner<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a (dyn Error + 'static)> {
    if let Some(error) = error.downcast_ref::<io::Error>() {
        return Some(error.get_ref()?);
    }
    if let Some(error) = error.downcast_ref::<FormError>() {
        return match error {
            FormError::Read(error) => Some(error),
            FormError::Sink(error) => Some(&**error),
            _ => None,
        };
    }
    if let Some(ImagePlanError::Form(error)) = error.downcast_ref() {
        return Some(error);
    }
    if let Some(ModulePlanError::Unsuited(error)) = error.downcast_ref() {
        return Some(error);
    }
    if let Some(RadarPlanError::Form(error)) = error.downcast_ref() {
        return Some(error);
    }
    if let Some(LinkError::Recording(error)) = error.downcast_ref() {
        return Some(error);
    }
    if let Some(PlotError::ImageSource(error)) = error.downcast_ref() {
        return Some(&**error);
    }
    if let Some(ProductError::Tiles(error)) = error.downcast_ref() {
        return Some(error);
    }
    if let Some(OpenError::File(error)) = error.downcast_ref() {
        return Some(error);
    }
    match error.downcast_ref() {
        Some(cphd::WriteError::Write(error)) => return Some(error),
        Some(cphd::WriteError::Read(error)) => return Some(error),
        _ => {}
    }
    match error.downcast_ref() {
        Some(recording::WriteError::Write(error)) => Some(error),
        Some(recording::WriteError::Read(error)) => Some(error),
        _ => None,
    }
}

fn of_forming(error: &FormError) -> Option<String> {
    let mut list: Vec<Advice> = error.remedies().iter().map(Advice::of).collect();
    if let FormError::Memory { purpose: CHECK, .. } = error {
        list.insert(0, Advice::new("check", "fewer pixels"));
    }
    let advice = joined(&list);
    Some(match error {
        FormError::BoundMissed { .. } if list.is_empty() => "; or allow a larger error".to_owned(),
        FormError::BoundMissed { .. } => format!(": {advice}; or allow a larger error"),
        _ if list.is_empty() => return None,
        FormError::Unsuited(_) if error.remedies() == [Remedy::SomeGrid] => format!("; {advice}"),
        _ => format!(": {advice}"),
    })
}

/// Remedy in the terms of the command line: a verb and its object.
struct Advice {
    verb: &'static str,
    object: String,
}

impl Advice {
    fn new(verb: &'static str, object: impl Into<String>) -> Self {
        Self {
            verb,
            object: object.into(),
        }
    }

    fn of(remedy: &Remedy) -> Self {
        let option = |name: &str| format!("--{}", name.replace('_', "-"));
        let options = |names: &[&str], and: &str| {
            let names: Vec<String> = names.iter().map(|name| option(name)).collect();
            names.join(and)
        };
        match remedy {
            Remedy::MoreMemory => Self::new("raise", "--memory"),
            Remedy::OtherFormer(names) => {
                Self::new("use", format!("--algorithm {}", names.join(" or ")))
            }
            Remedy::Word { option: name, word } => {
                Self::new("use", format!("{} {word}", option(name)))
            }
            Remedy::Smaller(names) => {
                Self::new("use", format!("a smaller {}", options(names, " or ")))
            }
            Remedy::Larger(name) => Self::new("use", format!("a larger {}", option(name))),
            Remedy::LeftOut(names) => Self::new("leave out", options(names, " and ")),
            Remedy::SmallerGrid => Self::new("use", "a smaller --grid"),
            Remedy::FewerPixels => Self::new("use", "a smaller or coarser --grid"),
            Remedy::FartherGrid => Self::new("use", "a --grid farther away or narrower"),
            Remedy::GridWithout => Self::new("leave that out", "of --grid"),
            Remedy::GridWith => Self::new("include these", "in --grid"),
            Remedy::FinerGrid => Self::new("use", "a finer --grid"),
            Remedy::PlanFor { error_db } => {
                Self::new("plan for less", format!("with --error-db {error_db:.0}"))
            }
            Remedy::SomeGrid => Self::new("give one,", SOME_GRID.trim_start_matches("give one, ")),
            // A remedy for which this command has no option.
            other => Self::new("try", format!("{other:?}")),
        }
    }
}

/// Join remedies as in `use a, b, or raise c`; a repeated verb is omitted.
fn joined(list: &[Advice]) -> String {
    let mut text = String::new();
    for (i, item) in list.iter().enumerate() {
        text += match i {
            0 => "",
            _ if i + 1 == list.len() => ", or ",
            _ => ", ",
        };
        if i == 0 || list[i - 1].verb != item.verb {
            text += item.verb;
            text += " ";
        }
        text += &item.object;
    }
    text
}

#[cfg(test)]
mod tests {
    use subaperture::focus::Reason;

    use super::*;

    fn unsuited(remedies: &[Remedy]) -> String {
        with_advice(&FormError::Unsuited(
            Reason::new("it cannot be").helped_by(remedies),
        ))
    }

    #[test]
    fn remedies_become_options() {
        use Remedy as R;
        let bp = R::OtherFormer(&["bp"]);
        for (remedies, advice) in [
            (&[][..], ""),
            (&[R::MoreMemory], ": raise --memory"),
            (
                &[R::FewerPixels, R::MoreMemory],
                ": use a smaller or coarser --grid, or raise --memory",
            ),
            (
                &[R::OtherFormer(&["rdbp", "bp"]), R::FartherGrid],
                ": use --algorithm rdbp or bp, or a --grid farther away or narrower",
            ),
            (
                &[R::Smaller(&["patch", "sub_cpi"]), R::MoreMemory],
                ": use a smaller --patch or --sub-cpi, or raise --memory",
            ),
            (
                &[R::Larger("patch"), R::MoreMemory],
                ": use a larger --patch, or raise --memory",
            ),
            (
                &[
                    R::Smaller(&["sub_cpi"]),
                    R::Word {
                        option: "mode",
                        word: "precise",
                    },
                    R::MoreMemory,
                ],
                ": use a smaller --sub-cpi, --mode precise, or raise --memory",
            ),
            (
                &[R::LeftOut(&["sub_cpi", "patch"]), bp],
                ": leave out --sub-cpi and --patch, or use --algorithm bp",
            ),
            (
                &[R::GridWithout, bp],
                ": leave that out of --grid, or use --algorithm bp",
            ),
            (
                &[R::GridWith, R::PlanFor { error_db: -71.3 }],
                ": include these in --grid, or plan for less with --error-db -71",
            ),
            (
                &[R::FinerGrid, R::PlanFor { error_db: -71.3 }],
                ": use a finer --grid, or plan for less with --error-db -71",
            ),
            (
                &[R::SomeGrid],
                "; give one, for example --grid x=-50:50:0.5,y=-50:50:0.5,z=0",
            ),
        ] {
            assert_eq!(unsuited(remedies), format!("it cannot be{advice}"));
        }
    }

    #[test]
    fn advice_is_found_below_wrapping_errors_and_given_once() {
        let memory = || FormError::Memory {
            purpose: "the image",
            needed_bytes: 1010,
            budget_bytes: 1000,
            remedies: &[Remedy::MoreMemory],
        };
        let whole = "the image needs 1010 bytes of the 1000 bytes allowed: raise --memory";
        assert_eq!(with_advice(&memory()), whole);
        assert_eq!(with_advice(&ImagePlanError::Form(memory())), whole);
        let error = anyhow::Error::new(memory()).context("focusing a.cphd");
        assert_eq!(one_line(&error), format!("focusing a.cphd: {whole}"));
        let missed = FormError::BoundMissed {
            predicted_db: -40.0,
            bound_db: -60.0,
            limit: Reason::new("kernels").helped_by(&[Remedy::OtherFormer(&["bp"])]),
        };
        assert_eq!(
            with_advice(&missed),
            "the predicted error is -40.0 dB, above the requested bound of -60 dB: kernels: use --algorithm bp; or allow a larger error"
        );
    }
}
