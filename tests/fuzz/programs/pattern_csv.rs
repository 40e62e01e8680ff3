#![no_main]
subaperture_fuzz::program!("pattern_csv");
