//! What is made of images: measures, comparisons, pictures, products.

mod compare;
mod made;
mod pairs;
mod plot_lines;
mod product;
mod quality;
mod quicklook;
