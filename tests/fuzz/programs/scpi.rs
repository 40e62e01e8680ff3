#![no_main]
subaperture_fuzz::program!("scpi");
