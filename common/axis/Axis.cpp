#include "common/axis/Axis.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace common {
namespace {

constexpr double kMinShare = 64.0 * std::numeric_limits<double>::epsilon();
constexpr double kMinRange = 1e-300, kLargest = 1e300;

bool is_resolvable(const AxisRange& range) {
  return range.high - range.low >=
         std::max(kMinShare * std::max(std::abs(range.low), std::abs(range.high)), kMinRange);
}

}  // namespace

AxisRange resolvable(AxisRange range) {
  if (!(range.low <= range.high)) return {0.0, 1.0};
  range = {std::clamp(range.low, -kLargest, kLargest), std::clamp(range.high, -kLargest, kLargest)};
  if (is_resolvable(range)) return range;
  const double middle = range.low / 2.0 + range.high / 2.0;
  const double half = std::max(kMinShare * std::abs(middle), kMinRange);
  return {middle - half, middle + half};
}

double axis_margin(double low, double high, double share) {
  if (is_resolvable({low, high})) return share * (high - low);
  return std::max(0.5, 0.1 * std::max(std::abs(low), std::abs(high)));
}

AxisRange with_margin(AxisRange values, double share) {
  const double margin = axis_margin(values.low, values.high, share);
  return resolvable({values.low - margin, values.high + margin});
}

double round_up(double value) {
  if (!(value > 0.0) || !std::isfinite(value)) return 1.0;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= value * (1.0 - 1e-12)) return factor * power;
  return 10.0 * power;
}

std::vector<double> tick_values(double from, double to, double most) {
  const auto [low, high] = resolvable({from, to});
  double step = round_up((high - low) / most), first = 0.0;
  int count = 0;
  const auto count_ticks = [&] {
    first = std::ceil(low / step - 1e-9);
    count = static_cast<int>(std::floor(high / step + 1e-9) - first) + 1;
  };
  for (count_ticks(); count < 2; count_ticks()) step = round_up(0.3 * step);
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back((first + i) * step);
  return values;
}

std::vector<std::string> tick_labels(const std::vector<double>& values) {
  std::vector<std::string> labels;
  const double step = values.size() > 1 ? values[1] - values[0] : 0.0;
  for (const double value : values) {
    const double digits = value == 0.0 || step <= 0.0 ? 0.0
                                                      : std::floor(std::log10(std::abs(value))) -
                                                            std::floor(std::log10(step * (1.0 + 1e-9))) + 1.0;
    labels.push_back(format_number(value, static_cast<int>(std::clamp(digits, 6.0, 17.0))));
  }
  return labels;
}

std::string format_number(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value == 0.0 ? 0.0 : value);  // 0, not -0
  return text;
}

}  // namespace common
