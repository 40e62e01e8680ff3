#![no_main]
subaperture_fuzz::program!("l0b");
