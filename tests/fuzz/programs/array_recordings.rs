#![no_main]
subaperture_fuzz::program!("array_recordings");
