//! Greek letters, superscripts and subscripts from the plain text that figures are written in.

const GREEK: [(&str, &str); 12] = [
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("epsilon", "ε"),
    ("eta", "η"),
    ("theta", "θ"),
    ("lambda", "λ"),
    ("mu", "µ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
];
const PLAIN: &str = "0123456789-+inux";
const RAISED: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ⁱⁿᵘˣ";
const LOWERED: &str = "₀₁₂₃₄₅₆₇₈₉₋₊ᵢₙᵤₓ";

/// The text in print: `sigma_u^2` is `σᵤ²`. What has no such form stays as it is.
pub fn typeset(text: &str) -> String {
    let (mut printed, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(first) = rest.chars().next() {
        let word = rest
            .chars()
            .take_while(char::is_ascii_alphabetic)
            .map(char::len_utf8)
            .sum();
        if word > 0 {
            let greek = GREEK.iter().find(|(name, _)| *name == &rest[..word]);
            printed.push_str(greek.map_or(&rest[..word], |(_, letter)| letter));
            rest = &rest[word..];
            continue;
        }
        rest = &rest[first.len_utf8()..];
        let table = match first {
            '^' => RAISED,
            '_' => LOWERED,
            _ => {
                printed.push(first);
                continue;
            }
        };
        // A sign and digits, or one letter that no other follows.
        let sign = usize::from(rest.starts_with(['-', '+']));
        let digits = rest[sign..].bytes().take_while(u8::is_ascii_digit).count();
        let letters = rest.bytes().take_while(u8::is_ascii_alphabetic).count();
        let fraction = rest[sign + digits..].strip_prefix('.');
        let fraction = fraction.is_some_and(|after| after.starts_with(|c: char| c.is_ascii_digit()));
        let length = match (digits, fraction) {
            (0, _) => usize::from(letters == 1),
            (_, true) => 0,
            _ => sign + digits,
        };
        let moved: Option<String> = rest[..length]
            .chars()
            .map(|c| table.chars().nth(PLAIN.chars().position(|p| p == c)?))
            .collect();
        match moved.filter(|moved| !moved.is_empty()) {
            Some(moved) => {
                printed.push_str(&moved);
                rest = &rest[length..];
            }
            None => printed.push(first),
        }
    }
    printed
}

#[cfg(test)]
mod tests {
    use super::typeset;

    #[test]
    fn words_become_letters_and_carets_become_superscripts() {
        assert_eq!(typeset("gamma = sigma_u^2 / sigma^2"), "γ = σᵤ² / σ²");
        assert_eq!(typeset("(m^-2), 2^16"), "(m⁻²), 2¹⁶");
        assert_eq!(typeset("1 - c (1 - 2/pi)"), "1 - c (1 - 2/π)");
    }

    #[test]
    fn other_text_stays() {
        for text in ["m^0.5 pip", "2^{bits}", "mse_se", "a_", "x^", "épée ^é", "sigmas", ""] {
            assert_eq!(typeset(text), text);
        }
    }
}
