//! Numbers as people read them.

/// A whole number with its thousands apart: `963,711`.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number of things: `1 thread`, `2 threads`.
pub fn count(number: u64, thing: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{} {thing}{plural}", grouped(number))
}

/// A number with about four significant digits: `0.1234`, `12.34`, `1,234`.
pub fn measured(number: f64) -> String {
    if !number.is_finite() {
        return number.to_string();
    }
    match number.abs() {
        n if n >= 999.95 => format!(
            "{}{}",
            if number < 0.0 { "-" } else { "" },
            grouped(n.round() as u64)
        ),
        n if n >= 99.995 => format!("{number:.1}"),
        n if n >= 9.9995 => format!("{number:.2}"),
        n if n >= 0.99995 || n == 0.0 => format!("{number:.3}"),
        _ => format!("{number:.4}"),
    }
}

/// A share in per cent: `28.5 %`, `12,450 %`.
pub fn percent(percent: f64) -> String {
    match percent {
        p if !p.is_finite() => p.to_string(),
        p if p >= 999.95 => format!("{} %", grouped(p.round() as u64)),
        p => format!("{p:.1} %"),
    }
}

/// Seconds: `3.21 s`, `12.3 ms`.
pub fn seconds(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{} ms", measured(seconds * 1e3))
    } else {
        format!("{} s", measured(seconds))
    }
}

/// Bytes: `12.34 MB`, in powers of 1000.
pub fn bytes(bytes: u64) -> String {
    let mut value = bytes as f64;
    let mut units = ["kB", "MB", "GB", "TB"].into_iter();
    let mut unit = "B";
    while value >= 1000.0 {
        let Some(larger) = units.next() else { break };
        value /= 1000.0;
        unit = larger;
    }
    if unit == "B" {
        format!("{bytes} B")
    } else {
        format!("{} {unit}", measured(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(963_711), "963,711");
        assert_eq!(grouped(u64::MAX), "18,446,744,073,709,551,615");
        assert_eq!(measured(919.7), "919.7");
        assert_eq!(measured(12_345.6), "12,346");
        assert_eq!(measured(0.012_345), "0.0123");
        assert_eq!(percent(28.46), "28.5 %");
        assert_eq!(percent(12_450.3), "12,450 %");
        assert_eq!(seconds(0.0123), "12.30 ms");
        assert_eq!(bytes(999), "999 B");
        assert_eq!(bytes(12_340_000), "12.34 MB");
    }
}
