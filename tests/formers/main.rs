//! Image formers against the defining sum, the exact former and theory: what they form, what they refuse, how well they predict their errors.

mod accuracy;
mod auto;
mod backprojection;
mod channels;
mod costs;
mod crooked_tracks;
mod defining_sum;
mod edges;
mod frequency_domain;
mod gotcha;
mod in_beam;
mod live;
mod movers;
mod options;
mod pfa_ffbp;
mod points;
mod portable;
mod random;
mod random_case;
mod stages;
mod stored_plans;
mod strip_scene;
mod surfaces;
mod sweep_motion;
mod tiles;
mod track_scene;
