//! Whole numbers in bits: runs and groups of small ones, and differences.

use super::thrift::Cursor;

/// The number of `width` bits, up to 64, at bit `at` of `bytes`.
fn bits(bytes: &[u8], at: usize, width: usize) -> Option<u64> {
    let (first, shift) = (at / 8, at % 8);
    let part = bytes.get(first..first + (shift + width).div_ceil(8))?;
    let whole = part.iter().rev().fold(0_u128, |whole, byte| whole << 8 | u128::from(*byte));
    u64::try_from((whole >> shift) & ((1_u128 << width) - 1)).ok()
}

/// `count` numbers of `width` bits, as runs of equal ones and groups of eight; `None` if they are damaged or fewer.
pub fn runs(bytes: &[u8], width: usize, count: usize) -> Option<Vec<u32>> {
    if width == 0 {
        return Some(vec![0; count]);
    }
    let (mut cursor, mut numbers) = (Cursor::new(bytes), Vec::with_capacity(count));
    if width > 32 {
        return None;
    }
    while numbers.len() < count {
        let head = usize::try_from(cursor.varint()?).ok()?;
        let left = count - numbers.len();
        if head & 1 == 0 {
            let value = cursor.take(width.div_ceil(8))?;
            let value = value.iter().rev().fold(0_u32, |whole, byte| whole << 8 | u32::from(*byte));
            numbers.resize(numbers.len() + (head >> 1).min(left), value);
            continue;
        }
        let groups = head >> 1;
        // The last group can be cut behind the last number.
        let rest = cursor.rest();
        for index in 0..groups.saturating_mul(8).min(left) {
            numbers.push(u32::try_from(bits(rest, index * width, width)?).ok()?);
        }
        cursor.take(groups.saturating_mul(width).min(rest.len()))?;
    }
    Some(numbers)
}

/// `count` numbers as differences from one to the next; `None` if they are damaged or another number.
pub fn differences(bytes: &[u8], count: usize) -> Option<Vec<i64>> {
    let mut cursor = Cursor::new(bytes);
    let mut size = || usize::try_from(cursor.varint()?).ok();
    let (block, parts, total) = (size()?, size()?, size()?);
    let mut last = cursor.integer()?;
    if total != count || parts == 0 || block % parts != 0 || block / parts % 8 != 0 || block == 0 {
        return None;
    }
    let (mut numbers, part) = (Vec::with_capacity(count), block / parts);
    numbers.extend((count > 0).then_some(last));
    while numbers.len() < count {
        let least = cursor.integer()?;
        for width in cursor.take(parts)? {
            let (width, rest) = (usize::from(*width), cursor.rest());
            let wanted = part.min(count - numbers.len());
            if wanted == 0 {
                break;
            }
            if width > 64 {
                return None;
            }
            for index in 0..wanted {
                last = last.wrapping_add(least).wrapping_add(bits(rest, index * width, width)?.cast_signed());
                numbers.push(last);
            }
            cursor.take((part / 8).saturating_mul(width).min(rest.len()))?;
        }
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_groups_follow_each_other() {
        // Three times 5, then 0 to 7 in groups of three bits.
        let bytes = [0x06, 0x05, 0x03, 0b1000_1000, 0b1100_0110, 0b1111_1010];
        assert_eq!(runs(&bytes, 3, 9), Some(vec![5, 5, 5, 0, 1, 2, 3, 4, 5]));
        assert_eq!(runs(&bytes, 3, 11), Some(vec![5, 5, 5, 0, 1, 2, 3, 4, 5, 6, 7]));
        assert_eq!(runs(&bytes, 3, 12), None);
        assert_eq!(runs(&bytes[..5], 3, 11), None);
        assert_eq!((runs(&[], 0, 2), runs(&bytes, 33, 1)), (Some(vec![0, 0]), None));
    }

    #[test]
    fn differences_add_up() {
        // Blocks of 128 in four parts; 7, then steps of -2 and 3 by turns.
        let mut bytes = vec![0x80, 0x01, 0x04, 0x05, 14, 3, 3, 0, 0, 0];
        bytes.extend([0b0010_1000, 0b0000_1010]);
        assert_eq!(differences(&bytes, 5), Some(vec![7, 5, 8, 6, 9]));
        assert_eq!(differences(&bytes, 4), None);
        for length in 0..bytes.len() - 1 {
            assert_eq!(differences(&bytes[..length], 5), None, "{length}");
        }
    }
}
