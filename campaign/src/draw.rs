//! Values of all flights, drawn from the campaign's seed.
//!
//! Each varied value has a random stream of its own, by its name: adding one changes no other's values.

use crate::declaration::{Campaign, Sampling, Varied};
use bus::random::{Stream, stream, uniform};
use rand_core::Rng as _;

/// Drawn numbers by flight, then in the order of the campaign's varied values. Numbers have nine significant digits: they
/// are read, typed again, and the same on every processor.
///
/// ```
/// use campaign::{declaration::Campaign, draw::draw};
/// let text = "manifest = \"a.toml\"\nflights = 4\n[[vary]]\nkey = \"x\"\nuniform = [0.0, 4.0]";
/// let campaign = Campaign::parse("c.toml".as_ref(), text)?;
/// // A Latin hypercube of four flights has one value in each quarter.
/// let mut quarters: Vec<f64> = draw(&campaign).iter().map(|flight| flight[0].floor()).collect();
/// quarters.sort_by(f64::total_cmp);
/// assert_eq!(quarters, [0.0, 1.0, 2.0, 3.0]);
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[must_use]
pub fn draw(campaign: &Campaign) -> Vec<Vec<f64>> {
    let flights = campaign.flights;
    if campaign.sampling == Sampling::Grid {
        return (0..flights).map(|flight| combination(&campaign.vary, flight)).collect();
    }
    let columns: Vec<Vec<f64>> = campaign.vary.iter().map(|varied| column(campaign, varied)).collect();
    (0..flights as usize).map(|flight| columns.iter().map(|column| column[flight]).collect()).collect()
}

/// The values of one varied value in all flights.
fn column(campaign: &Campaign, varied: &Varied) -> Vec<f64> {
    let mut random = stream(campaign.seed, &format!("campaign/{}", varied.name));
    let count = campaign.flights as usize;
    let quantiles: Vec<f64> = if campaign.sampling == Sampling::Random {
        (0..count).map(|_| uniform(&mut random)).collect()
    } else {
        let cells = permutation(&mut random, count);
        cells.into_iter().map(|cell| (cell as f64 + uniform(&mut random)) / count as f64).collect()
    };
    let is_whole = varied.distribution.is_whole();
    let value = |quantile| varied.distribution.at(quantile);
    quantiles.into_iter().map(value).map(|value| if is_whole { value } else { rounded(value) }).collect()
}

/// The numbers below `count` in random order (Fisher and Yates).
fn permutation(random: &mut Stream, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        // The bias of the remainder is below 1e-12 for the largest campaign.
        order.swap(last, (random.next_u64() % (last as u64 + 1)) as usize);
    }
    order
}

/// Combination number `index` of a grid: the last value varies fastest.
fn combination(vary: &[Varied], mut index: u64) -> Vec<f64> {
    let mut values: Vec<f64> = Vec::with_capacity(vary.len());
    for varied in vary.iter().rev() {
        let count = varied.distribution.count().unwrap_or(1);
        values.push(varied.distribution.nth(index % count));
        index /= count;
    }
    values.reverse();
    values
}

/// The value with nine significant digits.
pub(crate) fn rounded(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::draw;
    use crate::declaration::Campaign;

    fn campaign(text: &str) -> Campaign {
        Campaign::parse("c.toml".as_ref(), &format!("manifest = \"a.toml\"\n{text}")).unwrap()
    }

    #[test]
    fn another_varied_value_changes_none_of_the_others() {
        let one = "flights = 50\n[[vary]]\nkey = \"a\"\nnormal = [0, 1]\n";
        let two = format!("{one}[[vary]]\nkey = \"b\"\nuniform = [0, 1]");
        let column = |flights: Vec<Vec<f64>>| flights.into_iter().map(|flight| flight[0]).collect::<Vec<_>>();
        assert_eq!(column(draw(&campaign(one))), column(draw(&campaign(&two))));
        assert_ne!(column(draw(&campaign(one))), column(draw(&campaign(&format!("seed = 2\n{one}")))));
    }

    #[test]
    fn two_values_of_a_latin_hypercube_are_not_in_step() {
        let text =
            "flights = 400\n[[vary]]\nkey = \"a\"\nuniform = [0, 1]\n[[vary]]\nkey = \"b\"\nuniform = [0, 1]";
        let flights = draw(&campaign(text));
        let mean: f64 =
            flights.iter().map(|flight| (flight[0] - 0.5) * (flight[1] - 0.5)).sum::<f64>() / 400.0;
        // The covariance of independent values has a standard deviation of 1/12/20.
        assert!(mean.abs() < 4.0 / 240.0, "{mean}");
    }

    #[test]
    fn whole_numbers_keep_all_digits() {
        let text = "flights = 9\n[[vary]]\nkey = \"a\"\nintegers = [1234567891, 1234567899]";
        let mut drawn: Vec<f64> = draw(&campaign(text)).iter().map(|flight| flight[0]).collect();
        drawn.sort_by(f64::total_cmp);
        assert_eq!(drawn, (1..=9).map(|digit| 1_234_567_890.0 + f64::from(digit)).collect::<Vec<_>>());
    }

    #[test]
    fn a_grid_varies_the_last_value_fastest() {
        let text = "sampling = \"grid\"\n[[vary]]\nkey = \"a\"\nvalues = [1, 2]\n[[vary]]\nkey = \"b\"\nintegers = [5, 6]";
        assert_eq!(draw(&campaign(text)), [[1.0, 5.0], [1.0, 6.0], [2.0, 5.0], [2.0, 6.0]]);
    }
}
