#![no_main]
subaperture_fuzz::program!("track_csv");
