//! What is made of images: measures, comparisons, pictures, products; the library as its users have it.

mod compare;
mod decoded;
mod examples;
mod features;
mod made;
mod maps;
mod pairs;
mod plot_lines;
mod product;
mod quality;
mod quicklook;
mod terrain;
