#![no_main]
subaperture_fuzz::program!("phase_csv");
