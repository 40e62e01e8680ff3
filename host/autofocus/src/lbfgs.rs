//! Minimisation of smooth functions of many variables by L-BFGS (Liu and Nocedal, On the limited memory BFGS method for large scale
//! optimization, 1989), with backtracking line search (Armijo condition).

/// Number of steps stored.
const MEMORY: usize = 8;

/// Fraction of the predicted decrease that a step must reach (Armijo), and largest number of halvings of a step.
const FALL: f64 = 1e-4;
const HALVINGS: usize = 20;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Minimise from `start` in at most `steps` steps, until a step decreases the value by less than the fraction `still`. `first` is the length of the
/// first step, in units of the variables. `function` returns the value and its gradient, or `None` to stop at the best so far.
pub(crate) fn least(
    start: Vec<f64>,
    first: f64,
    steps: usize,
    still: f64,
    mut function: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<Vec<f64>> {
    let (mut value, mut gradient) = function(&start)?;
    let mut at = start;
    let mut pairs: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    for _ in 0..steps {
        let length = dot(&gradient, &gradient).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            break;
        }
        let mut direction = descent(&gradient, &pairs, first / length);
        let mut slope = dot(&direction, &gradient);
        if slope >= 0.0 {
            pairs.clear();
            direction = gradient.iter().map(|g| -g * first / length).collect();
            slope = -first * length;
        }
        let mut found = None;
        for halving in 0..HALVINGS {
            let part = 0.5f64.powi(halving as i32);
            let there: Vec<f64> = at
                .iter()
                .zip(&direction)
                .map(|(x, d)| x + part * d)
                .collect();
            let Some((there_value, there_gradient)) = function(&there) else {
                return Some(at);
            };
            if there_value <= value + FALL * part * slope {
                found = Some((there, there_value, there_gradient));
                break;
            }
        }
        let Some((there, there_value, there_gradient)) = found else {
            match pairs.is_empty() {
                true => break,
                // The stored curvature fails: restart with steepest descent.
                false => pairs.clear(),
            }
            continue;
        };
        let moved: Vec<f64> = there.iter().zip(&at).map(|(a, b)| a - b).collect();
        let turned: Vec<f64> = there_gradient
            .iter()
            .zip(&gradient)
            .map(|(a, b)| a - b)
            .collect();
        // Only a positive curvature is used.
        if dot(&moved, &turned) > 1e-12 * dot(&turned, &turned).sqrt() * dot(&moved, &moved).sqrt()
        {
            pairs.push((moved, turned));
            if pairs.len() > MEMORY {
                pairs.remove(0);
            }
        }
        let gained = value - there_value;
        (at, value, gradient) = (there, there_value, there_gradient);
        if gained <= still * value.abs() {
            break;
        }
    }
    Some(at)
}

/// Negated product of the gradient with the inverse Hessian from the pairs; without pairs the inverse Hessian is `scale`.
fn descent(gradient: &[f64], pairs: &[(Vec<f64>, Vec<f64>)], scale: f64) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut parts = Vec::with_capacity(pairs.len());
    for (moved, turned) in pairs.iter().rev() {
        let part = dot(moved, &direction) / dot(moved, turned);
        direction
            .iter_mut()
            .zip(turned)
            .for_each(|(d, y)| *d -= part * y);
        parts.push(part);
    }
    let scale = match pairs.last() {
        Some((moved, turned)) => dot(moved, turned) / dot(turned, turned),
        None => scale,
    };
    direction.iter_mut().for_each(|d| *d *= scale);
    for ((moved, turned), part) in pairs.iter().zip(parts.iter().rev()) {
        let other = dot(turned, &direction) / dot(moved, turned);
        direction
            .iter_mut()
            .zip(moved)
            .for_each(|(d, s)| *d += (part - other) * s);
    }
    direction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_of_rosenbrock_function_is_found() {
        // Rosenbrock's function in 10 variables: 0 at ones.
        let function = |x: &[f64]| {
            let mut gradient = vec![0.0; x.len()];
            let mut value = 0.0;
            for i in 0..x.len() - 1 {
                let (a, b) = (x[i + 1] - x[i] * x[i], 1.0 - x[i]);
                value += 100.0 * a * a + b * b;
                gradient[i] -= 400.0 * x[i] * a + 2.0 * b;
                gradient[i + 1] += 200.0 * a;
            }
            Some((value, gradient))
        };
        let start = vec![-0.5; 10];
        let found = least(start, 0.1, 500, 0.0, function).unwrap();
        assert!(found.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn minimisation_stops_when_the_function_returns_none() {
        let mut calls = 0;
        let found = least(vec![1.0], 0.1, 100, 0.0, |x| {
            calls += 1;
            (calls < 4).then(|| (x[0] * x[0], vec![2.0 * x[0]]))
        });
        assert!(found.unwrap()[0].abs() < 1.0);
    }
}
