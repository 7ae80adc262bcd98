//! What is left out changes no bit of a picture, or no more than the render says; and it really is left out.

use tison::backend::BackendKind;
use tison::bench::skip::{Assets, Done, Proof, Scale, Subject, done, left_out};
use tison::render::Job;
use tison::scene::{Skip, Skips};

fn small(subject: &Subject, kind: BackendKind, skips: Skips) -> Done {
    let assets = Assets::new(Scale::Small).expect("a folder for the scene");
    done(subject, &assets, kind, skips).unwrap_or_else(|e| panic!("{}: {e:?}", subject.name))
}

/// A new skip cannot be forgotten: [`Subject::of`] knows a scene for each.
#[test]
fn each_skip_leaves_something_out_and_changes_no_more_than_it_may() {
    for &skip in Skip::ALL {
        for &kind in BackendKind::COMPILED {
            let subject = Subject::of(skip, Scale::Small);
            let (on, off) = (small(&subject, kind, Skips::ALL), small(&subject, kind, Skips::ALL.without(skip)));
            let (name, proof) = (skip.name(), Proof::of(skip, &on, &off));
            assert!(proof.holds(), "{name}, {kind:?}: {proof}");
            assert_eq!(skip.is_exact(), !matches!(proof, Proof::Within { .. }), "{name}, {kind:?}: {proof}");
            let (count, what) = left_out(skip, &on, &off);
            assert!(count > 0, "{name}, {kind:?}: no {what} left out");
            let (count, what) = left_out(skip, &on, &on);
            assert_eq!(count, 0, "{name}, {kind:?}: {what}");
        }
    }
}

/// The bounded ones do change their pictures: the bound is not that of a case without a difference.
#[test]
fn what_is_bounded_is_not_nothing() {
    for &skip in Skip::ALL.iter().filter(|skip| !skip.is_exact()) {
        let (subject, kind) = (Subject::of(skip, Scale::Small), BackendKind::Native);
        let (on, off) = (small(&subject, kind, Skips::ALL), small(&subject, kind, Skips::ALL.without(skip)));
        let Proof::Within { difference, bound } = Proof::of(skip, &on, &off) else { panic!("{skip:?}") };
        assert!(difference > 0.0 && difference > 1e-4 * bound, "{skip:?}: {difference} is far below {bound}");
    }
}

/// All of them together.
#[test]
fn no_skip_at_all_gives_the_same_picture() {
    for &kind in BackendKind::COMPILED {
        for skip in [Skip::AnyHit, Skip::WeightCut, Skip::UnusedAssets, Skip::Fresnel, Skip::DarkLights] {
            let mut subject = Subject::of(skip, Scale::Small);
            subject.job = Job { min_weight: 0.0, ..subject.job };
            let (on, off) = (small(&subject, kind, Skips::ALL), small(&subject, kind, Skips::NONE));
            assert_eq!(Proof::of(Skip::Secondary, &on, &off), Proof::SameBytes, "{}, {kind:?}", subject.name);
        }
    }
}
