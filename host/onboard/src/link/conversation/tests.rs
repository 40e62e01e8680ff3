//! The machine without a line: what happens is told, time is given.

use super::*;
use crate::link::counts::Counts;
use crate::link::intake::Nowhere;
use crate::link::job::Wanted;
use crate::link::settings::Settings;
use subaperture_core::link::{Arithmetic, LinkCounters, Report};
use subaperture_core::stream::{Capacity, PulseCounters};

fn somebody() -> Identity {
    Identity {
        arithmetic: Arithmetic::Float,
        capacity: Capacity {
            pulses: 1,
            frequencies: 1,
            range_bins: 2,
            doppler_bins: 1,
            patches: 1,
        },
        version: "a module".to_owned(),
    }
}

/// A conversation about nothing, and the line that it speaks over.
struct Scene<'c> {
    conversation: Conversation<'c>,
    outbox: Outbox,
    now: Instant,
}

impl Scene<'_> {
    /// Tells what happened, and that all that was said has gone.
    fn tell(&mut self, event: Event) -> Step {
        let step = self.conversation.step(event, self.now, &mut self.outbox);
        let bytes = self.outbox.backlog();
        self.outbox.written(bytes, Some(1_000_000));
        step
    }

    /// The module says how it stands.
    fn hear(&mut self, state: ModuleState, configuration: u32) -> Step {
        let status = Status {
            state,
            configuration,
            run: 0,
            next_pulse: 0,
            accept_through: 0,
            maps: 0,
            link: LinkCounters::default(),
            pulses: PulseCounters::default(),
        };
        self.conversation.hear(&Report::Status(status)).unwrap();
        self.tell(Event::Exchanged)
    }
}

/// Has `act` play a scene with a module that is known or not.
fn play(identity: Option<Identity>, act: impl FnOnce(&mut Scene<'_>)) -> Counts {
    let mut ledger = Ledger::new(Settings::default());
    let mut nowhere = Nowhere;
    let intake = Intake::new(Wanted::nothing(), &mut [], &mut nowhere);
    act(&mut Scene {
        conversation: Conversation::new(&mut ledger, Told::nothing(), intake, identity),
        outbox: Outbox::new(),
        now: Instant::now(),
    });
    ledger.counts
}

#[test]
fn a_greeting_is_repeated_until_the_module_counts_as_silent() {
    play(None, |scene| {
        let start = scene.now;
        let mut step = scene.tell(Event::Begun);
        let mut greetings = 1;
        let mut greeted = scene.conversation.times.greeted;
        while let Step::Exchange(wait) = step {
            scene.now += wait;
            step = scene.tell(Event::Exchanged);
            greetings += u32::from(scene.conversation.times.greeted > greeted);
            greeted = scene.conversation.times.greeted;
        }
        assert!(matches!(step, Step::Over(Err(LinkError::Silent))));
        // Ten seconds of silence: a greeting at the start and one every half second.
        let taken_s = since(start, scene.now).as_secs_f64();
        assert!((10.0..10.1).contains(&taken_s), "{taken_s}");
        assert_eq!(greetings, 21);
    });
}

#[test]
fn a_module_that_answers_is_configured_step_by_step() {
    play(Some(somebody()), |scene| {
        assert!(matches!(scene.tell(Event::Begun), Step::Exchange(_)));
        let id = scene.conversation.ledger.configuration;
        assert!(matches!(
            scene.hear(ModuleState::Idle, 0),
            Step::Exchange(_)
        ));
        let configuring = |scene: &Scene<'_>| match scene.conversation.state {
            State::Configuring(setting) => Some(setting),
            _ => None,
        };
        assert_eq!(configuring(scene), Some(Setting::Configure));
        scene.hear(ModuleState::Idle, id);
        assert_eq!(configuring(scene), Some(Setting::Ready));
        // It began anew meanwhile: all is told again, under another number.
        scene.hear(ModuleState::Idle, 0);
        assert_eq!(configuring(scene), Some(Setting::Abort));
        assert_eq!(scene.conversation.ledger.configuration, id + 1);
        scene.hear(ModuleState::Idle, 0);
        scene.hear(ModuleState::Idle, id + 1);
        // There is nothing to be mapped.
        let step = scene.hear(ModuleState::Ready, id + 1);
        assert!(matches!(step, Step::Over(Ok(()))));
    });
}

#[test]
fn a_line_that_fails_is_connected_anew_so_often_and_no_more() {
    let broken = || Event::Failed(LinkError::Line(std::io::ErrorKind::BrokenPipe.into()));
    let counts = play(Some(somebody()), |scene| {
        scene.tell(Event::Begun);
        for _ in 0..FRUITLESS {
            assert!(matches!(scene.tell(broken()), Step::Anew(_)));
            assert!(matches!(scene.tell(Event::Connected), Step::Exchange(_)));
        }
        let step = scene.tell(broken());
        assert!(matches!(step, Step::Over(Err(LinkError::Line(_)))));
    });
    assert_eq!((counts.reconnects, counts.restarts), (8, 0));
}
