//! Values of all flights, drawn from the campaign's seed.
//!
//! Each varied value has a random stream of its own, by its name: adding one changes no other's values.

use crate::declaration::{Campaign, Sampling, Varied};
use bus::random::{Stream, stream, uniform};
use rand_core::Rng as _;
use sobol::{Sobol, params::JoeKuoD6};

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
    let columns = campaign.vary.iter().enumerate().map(|(index, varied)| column(campaign, index, varied));
    let columns: Vec<Vec<f64>> = columns.collect();
    (0..flights as usize).map(|flight| columns.iter().map(|column| column[flight]).collect()).collect()
}

/// The values of varied value number `index` in all flights.
fn column(campaign: &Campaign, index: usize, varied: &Varied) -> Vec<f64> {
    let mut random = stream(campaign.seed, &format!("campaign/{}", varied.name));
    let count = campaign.flights as usize;
    let quantiles: Vec<f64> = match campaign.sampling {
        Sampling::Random | Sampling::Grid => (0..count).map(|_| uniform(&mut random)).collect(),
        Sampling::Sobol => sobol(&mut random, index, count),
        Sampling::LatinHypercube => {
            let cells = permutation(&mut random, count);
            cells.into_iter().map(|cell| (cell as f64 + uniform(&mut random)) / count as f64).collect()
        }
    };
    let is_whole = varied.distribution.is_whole();
    let value = |quantile| varied.distribution.at(quantile);
    quantiles.into_iter().map(value).map(|value| if is_whole { value } else { rounded(value) }).collect()
}

/// Bits of a number of the Sobol sequence: those of a `f64`'s fraction.
const SOBOL_BITS: u32 = 52;

/// Dimension number `index` of a Sobol sequence, with all its bits shifted by the same random ones: each number is uniform, and
/// the even filling stays (Owen, "Randomly permuted (t,m,s)-nets", 1995, has the reasons for a shift).
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to below 2^52")]
fn sobol(random: &mut Stream, index: usize, count: usize) -> Vec<f64> {
    let scale = (1_u64 << SOBOL_BITS) as f64;
    let shift = random.next_u64() >> (u64::BITS - SOBOL_BITS);
    let sequence = Sobol::<f64>::new(index + 1, &JoeKuoD6::minimal());
    let numbers = sequence.take(count).map(|point| (point[index] * scale) as u64);
    numbers.map(|number| (number ^ shift) as f64 / scale).collect()
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
    rounded_to(value, 9)
}

/// The value with `digits` significant digits.
pub(crate) fn rounded_to(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
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

    #[test]
    fn a_sobol_sequence_fills_every_cell_of_the_plane_once() {
        let text = "sampling = \"sobol\"\nflights = 64\n[[vary]]\nkey = \"a\"\nuniform = [0, 8]\n[[vary]]\nkey = \"b\"\nuniform = [0, 8]";
        let cells = |text: &str| {
            let cell = |flight: &Vec<f64>| (flight[0].floor() as u32, flight[1].floor() as u32);
            let mut cells: Vec<(u32, u32)> = draw(&campaign(text)).iter().map(cell).collect();
            cells.sort_unstable();
            cells.dedup();
            cells.len()
        };
        // Each of 8 x 8 cells: neither independent values nor a Latin hypercube do that.
        assert_eq!(cells(text), 64);
        assert!(cells(&text.replace("sobol", "latin-hypercube")) < 60);
        let [first, other] = ["seed = 1", "seed = 2"].map(|seed| draw(&campaign(&format!("{seed}\n{text}"))));
        assert_ne!(first, other);
        // The first flights of a longer campaign are those of the shorter one, and another varied value changes no other.
        let more = text.replace("flights = 64", "flights = 100") + "\n[[vary]]\nkey = \"c\"\nnormal = [0, 1]";
        let longer = draw(&campaign(&format!("seed = 1\n{more}")));
        assert!(first.iter().zip(&longer).all(|(short, long)| short[..] == long[..2]));
    }
}
