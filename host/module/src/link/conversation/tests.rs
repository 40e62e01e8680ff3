//! Tests of the state machine without a line: events and time are supplied.

use subaperture_core::link::Status;

use super::*;
use crate::link::counts::Counts;
use crate::link::job::Wanted;
use crate::link::products::{DiscardMaps, Products};
use crate::link::settings::Settings;
use subaperture_core::link::{Arithmetic, ImageCapacity, LinkCounters, Report};
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
        image: ImageCapacity::default(),
        version: "a module".to_owned(),
    }
}

/// Conversation about an empty job, with its line.
struct Scene<'c> {
    conversation: Conversation<'c>,
    outbox: Outbox,
    now: Instant,
}

impl Scene<'_> {
    /// Pass an event, with everything sent.
    fn send(&mut self, event: Event) -> Step {
        let step = self.conversation.step(event, self.now, &mut self.outbox);
        let bytes = self.outbox.backlog();
        self.outbox.written(bytes, Some(1_000_000));
        step
    }

    /// Pass a status of the module.
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
        self.send(Event::Exchanged)
    }
}

/// Run `act` on a scene with a known or unknown module.
fn play(identity: Option<Identity>, act: impl FnOnce(&mut Scene<'_>)) -> Counts {
    let mut ledger = Ledger::new(Settings::default());
    let mut nowhere = DiscardMaps;
    let intake = Intake::new(Wanted::empty(), &mut [], Products::Maps(&mut nowhere));
    act(&mut Scene {
        conversation: Conversation::new(&mut ledger, JobSettings::empty(), intake, identity),
        outbox: Outbox::new(),
        now: Instant::now(),
    });
    ledger.counts
}

#[test]
fn greeting_repeats_until_module_counts_as_silent() {
    play(None, |scene| {
        let start = scene.now;
        let mut step = scene.send(Event::Begun);
        let mut greetings = 1;
        let mut greeted = scene.conversation.times.greeted;
        while let Step::Exchange(wait) = step {
            scene.now += wait;
            step = scene.send(Event::Exchanged);
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
fn answering_module_is_configured_step_by_step() {
    play(Some(somebody()), |scene| {
        assert!(matches!(scene.send(Event::Begun), Step::Exchange(_)));
        assert!(matches!(
            scene.hear(ModuleState::Idle, 0),
            Step::Exchange(_)
        ));
        let id = scene.conversation.ledger.configuration;
        let configuring = |scene: &Scene<'_>| match scene.conversation.state {
            State::Configuring(setting) => Some(setting),
            _ => None,
        };
        assert_eq!(configuring(scene), Some(Setting::Configure));
        scene.hear(ModuleState::Idle, id);
        assert_eq!(configuring(scene), Some(Setting::Ready));
        // It restarted: everything is sent again under another number.
        scene.hear(ModuleState::Idle, 0);
        assert_eq!(configuring(scene), Some(Setting::Abort));
        scene.hear(ModuleState::Idle, 0);
        assert_eq!(scene.conversation.ledger.configuration, id + 1);
        scene.hear(ModuleState::Idle, id + 1);
        // There is nothing to map.
        let step = scene.hear(ModuleState::Ready, id + 1);
        assert!(matches!(step, Step::Over(Ok(()))));
    });
}

#[test]
fn failing_line_is_reconnected_a_limited_number_of_times() {
    let broken = || Event::Failed(LinkError::Line(std::io::ErrorKind::BrokenPipe.into()));
    let counts = play(Some(somebody()), |scene| {
        scene.send(Event::Begun);
        for _ in 0..FRUITLESS {
            assert!(matches!(scene.send(broken()), Step::Restart(_)));
            assert!(matches!(scene.send(Event::Connected), Step::Exchange(_)));
        }
        let step = scene.send(broken());
        assert!(matches!(step, Step::Over(Err(LinkError::Line(_)))));
    });
    assert_eq!((counts.reconnects, counts.restarts), (8, 0));
}
