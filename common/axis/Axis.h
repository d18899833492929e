// The range of an axis of numbers, and the round numbers in it as text.
#pragma once

#include <string>
#include <vector>

namespace common {

struct AxisRange {
  double low, high;
};

// The range, made wider where doubles cannot divide it: its length is at least a few dozen units in the last
// place of its ends. [0, 1] unless low <= high.
AxisRange resolvable(AxisRange range);
// The margin beside values in [low, high]: `share` of their range, or one that suits a constant where they
// differ by rounding only.
double axis_margin(double low, double high, double share);
// The resolvable range of an axis that shows values in the range, with that margin. [0, 1] unless low <=
// high.
AxisRange with_margin(AxisRange values, double share);

// The smallest of … 0.1, 0.2, 0.5, 1, 2, 5, 10 … that is at least `value`; 1 if value is not positive and
// finite.
double round_up(double value);
// Round numbers in the resolvable range [from, to], ascending: two to `most` + 1 of them.
std::vector<double> tick_values(double from, double to, double most = 7.0);
// Their texts, which differ.
std::vector<std::string> tick_labels(const std::vector<double>& values);
std::string format_number(double value, int digits = 6);  // as by %g: "0.2", "45.25", "1e-13"

}  // namespace common
