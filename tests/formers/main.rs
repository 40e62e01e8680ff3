//! Image formers against the exact sum and theory: what they form, what they refuse, how well they know their errors.

mod accuracy;
mod auto;
mod backprojection;
mod channels;
mod costs;
mod crooked_tracks;
mod edges;
mod frequency_domain;
mod gotcha;
mod live;
mod movers;
mod options;
mod pfa_ffbp;
mod points;
mod portable;
mod random;
mod random_case;
mod stages;
mod strip_scene;
mod surfaces;
mod sweep_motion;
mod tiles;
mod track_scene;
