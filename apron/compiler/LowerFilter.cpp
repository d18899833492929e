// Filters: coefficient tables for correlation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "common/text/Suggestion.h"

namespace apron::compiler {

using program::Filter;
using program::Opcode;

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kMinParameter = 0.01F;  // in the precision of constants
constexpr double kMaxParameter = 1e6;
// A filter reaches three standard deviations to either side.
constexpr double kReach = 3.0;
constexpr double kMaxGaussian = (program::kMaxFilterExtent - 1) / 2.0 / kReach;

int filter_radius(double width) {
  return static_cast<int>(std::ceil(kReach * std::min(width, kMaxGaussian)));
}

// Coefficients weight(dx, dy), dx columns east and dy rows south of the centre, optionally normalised to a
// sum of 1.
template <class Weight>
Filter make_filter(std::string name, int radius_x, int radius_y, bool normalize, const Weight& weight) {
  Filter filter{std::move(name),
                static_cast<std::uint32_t>(2 * radius_x + 1),
                static_cast<std::uint32_t>(2 * radius_y + 1),
                {}};
  std::vector<double> values;
  double sum = 0.0;
  for (int y = -radius_y; y <= radius_y; ++y)
    for (int x = -radius_x; x <= radius_x; ++x) sum += values.emplace_back(weight(x, y));
  for (const double value : values)
    filter.coefficients.push_back(static_cast<float>(normalize ? value / sum : value));
  return filter;
}

}  // namespace

// A compile-time constant from kMinParameter to `high`, a parameter of a filter.
double Lowering::real_constant(const Expression& expression, std::string_view subject, double high) {
  const float value = number_constant(expression, subject);
  if (!(value >= kMinParameter && value <= high))
    fail(expression.location, "{} must be from {} to {}, not {}", subject, kMinParameter,
         std::floor(100.0 * high) / 100.0, value);
  return value;
}

std::optional<std::uint32_t> Lowering::find_filter(std::string_view name) const {
  const std::vector<Filter>& all = builder_.program().filters;
  const auto found = std::ranges::find(all, name, &Filter::name);
  if (found == all.end()) return std::nullopt;
  return static_cast<std::uint32_t>(found - all.begin());
}

std::uint32_t Lowering::require_filter(const Expression& name) const {
  const std::string& filter_name = string_literal(name, "a filter's name");
  if (const std::optional<std::uint32_t> index = find_filter(filter_name)) return *index;
  std::vector<std::string> known;
  for (const Filter& filter : builder_.program().filters) known.push_back(filter.name);
  fail(name.location, "no filter '{}' was created before{}", filter_name,
       common::did_you_mean(filter_name, known));
}

// The filter's index; filters made of constants are shared.
std::uint32_t Lowering::intern_filter(Filter filter) {
  std::vector<Filter>& all = builder_.program().filters;
  const auto same = [&](const Filter& candidate) {
    return candidate.name == filter.name && candidate.width == filter.width &&
           candidate.coefficients == filter.coefficients;
  };
  const auto found = std::ranges::find_if(all, same);
  if (found != all.end()) return static_cast<std::uint32_t>(found - all.begin());
  all.push_back(std::move(filter));
  return static_cast<std::uint32_t>(all.size() - 1);
}

Value Lowering::lower_filter(const Builtin& builtin, const Expressions& arguments, Location location,
                             ResultDestination* destination) {
  constexpr std::string_view kWhat = "a filter";
  if (builtin.form == BuiltinForm::kFilterGauss)
    return lower_gauss(builtin, arguments, location, destination);
  std::uint32_t index = 0;
  if (builtin.form == BuiltinForm::kFilterDo) {
    index = require_filter(arguments[1]);
  } else if (builtin.form == BuiltinForm::kFilterEdge) {
    index = intern_filter({"$edge", 3, 3, {-1, -1, -1, -1, 8, -1, -1, -1, -1}});
  } else {
    const double along = real_constant(arguments[1], "the width of a Gaussian", kMaxGaussian);
    const double across = real_constant(arguments[2], "the width of a Gaussian", kMaxGaussian);
    const double angle = number_constant(arguments[3], "the angle of a Gaussian");
    const int radius = filter_radius(std::max(along, across));
    index = intern_filter(make_filter(fmt::format("$ani {} {} {}", along, across, angle), radius, radius,
                                      true, [&](double x, double y) {
                                        const double u = (x * std::cos(angle) + y * std::sin(angle)) / along;
                                        const double v = (y * std::cos(angle) - x * std::sin(angle)) / across;
                                        return std::exp(-0.5 * (u * u + v * v));
                                      }));
  }
  const Value source = lower_register(arguments[0], kWhat);
  if (builtin.form == BuiltinForm::kFilterGaussAni) require_floats(builtin, source, location);
  return emit_out_of_place(Opcode::kFilterDo, {source}, {filter_operand(index)}, destination, location);
}

// Fails if the value is a register of integers: the filter's elements are fractions.
void Lowering::require_floats(const Builtin& builtin, const Value& value, Location location) const {
  if (!builder_.shape(value).is_integer()) return;
  fail(location, "'{}' takes registers of floats, and {} {}: write float(…)", builtin.name,
       describe_name(value), program::cell_type_name(builder_.shape(value).type));
}

// The filter is separable: one by rows and one by columns take fewer steps than the two-dimensional one.
Value Lowering::lower_gauss(const Builtin& builtin, const Expressions& arguments, Location location,
                            ResultDestination* destination) {
  const double width = real_constant(arguments[1], "the width of a Gaussian", kMaxGaussian);
  const int radius = filter_radius(width);
  const auto gaussian = [&](double x, double y) {
    return std::exp(-0.5 * (x * x + y * y) / (width * width));
  };
  const std::uint32_t row =
      intern_filter(make_filter(fmt::format("$gauss {}", width), radius, 0, true, gaussian));
  const std::uint32_t column =
      intern_filter(make_filter(fmt::format("$gauss {}", width), 0, radius, true, gaussian));
  const Value source = lower_register(arguments[0], "a filter");
  require_floats(builtin, source, location);
  const Value rows = emit_out_of_place(Opcode::kFilterDo, {source}, {filter_operand(row)}, nullptr, location);
  return emit_out_of_place(Opcode::kFilterDo, {rows}, {filter_operand(column)}, destination, location);
}

void Lowering::lower_filter_create(const Expression& call) {
  const std::string& name = string_literal(call.children[0], "a filter's name");
  const int width = integer_constant(call.children[1], "a filter's width");
  const int height = integer_constant(call.children[2], "a filter's height");
  const int max_side = static_cast<int>(program::kMaxFilterExtent);
  if (width < 1 || height < 1 || width > max_side || height > max_side)
    fail(call.location, "a filter is of 1x1 to {0}x{0} elements", max_side);
  if (find_filter(name)) fail(call.location, "there is a filter '{}' already", name);
  builder_.program().filters.push_back({name, static_cast<std::uint32_t>(width),
                                        static_cast<std::uint32_t>(height),
                                        std::vector<float>(std::size_t(width) * std::size_t(height))});
}

// filter.fill3x3 and filter.fill5x5.
void Lowering::lower_filter_fill(const Expressions& arguments) {
  const std::uint32_t index = require_filter(arguments[0]);
  const Filter& filter = builder_.program().filters[index];
  const std::uint32_t side = arguments.size() == 10 ? 3 : 5;
  if (filter.width != side || filter.height != side)
    fail(arguments[0].location, "the filter '{}' is of {}x{} elements, not {}x{}", filter.name, filter.width,
         filter.height, side, side);
  for (std::size_t i = 1; i < arguments.size(); ++i) {
    const Value value = lower_scalar(arguments[i], "a filter's element");
    builder_.emit(Opcode::kFilterSet, {},
                  {filter_operand(index), builder_.literal_operand(static_cast<double>(i - 1)),
                   builder_.operand(value)});
    builder_.release(value);
  }
}

// filter.setElement(name, x, y, v): column x, row y; with a run-time column only the element's index is
// checked.
void Lowering::lower_filter_set_element(const Expressions& arguments) {
  constexpr std::string_view kWhat = "'filter.setElement'";
  const std::uint32_t index = require_filter(arguments[0]);
  const Filter filter = builder_.program().filters[index];
  const Value x = lower_scalar(arguments[1], kWhat);
  const Value y = lower_scalar(arguments[2], kWhat);
  const auto check = [&](const Value& value, std::uint32_t size, const Expression& argument) {
    if (!value.is_constant()) return;
    if (value.constant >= 0.0F && value.constant < static_cast<float>(size) &&
        value.constant == std::floor(value.constant)) {
      return;
    }
    fail(argument.location, "the filter '{}' is of {}x{} elements, counted from 0", filter.name, filter.width,
         filter.height);
  };
  check(x, filter.width, arguments[1]);
  check(y, filter.height, arguments[2]);
  const Value width = Value::from_constant(static_cast<float>(filter.width));
  const Value row_offset = emit_elementwise(Opcode::kMul, {y, width}, arguments[2].location, nullptr);
  const Value number = emit_elementwise(Opcode::kAdd, {row_offset, x}, arguments[1].location, nullptr);
  const Value value = lower_scalar(arguments[3], kWhat);
  builder_.emit(Opcode::kFilterSet, {},
                {filter_operand(index), builder_.operand(number), builder_.operand(value)});
}

// filter.kernel.gabor(name, width, angle, wavelength[, phase[, aspect]]) fills the filter, or creates it
// as large as the width requires.
void Lowering::lower_gabor(const Expressions& arguments) {
  const std::string& name = string_literal(arguments[0], "a filter's name");
  const std::optional<std::uint32_t> known = find_filter(name);
  const double aspect =
      arguments.size() > 5 ? real_constant(arguments[5], "a Gabor filter's aspect", kMaxParameter) : 1.0;
  const double least = std::min(aspect, 1.0);
  const double width =
      real_constant(arguments[1], "a Gabor filter's width", known ? kMaxParameter : kMaxGaussian * least);
  const double angle = number_constant(arguments[2], "a Gabor filter's angle");
  const double wave = real_constant(arguments[3], "a Gabor filter's wavelength", kMaxParameter);
  const double phase = arguments.size() > 4 ? number_constant(arguments[4], "a Gabor filter's phase") : 0.0;
  const auto weight = [&](double x, double y) {
    const double u = x * std::cos(angle) + y * std::sin(angle);
    const double v = y * std::cos(angle) - x * std::sin(angle);
    return std::exp(-0.5 * (u * u + aspect * aspect * v * v) / (width * width)) *
           std::cos(2.0 * kPi * u / wave + phase);
  };
  if (known) return emit_filter_fill(*known, weight);
  const int radius = filter_radius(width / least);
  intern_filter(make_filter(name, radius, radius, false, weight));
}

// All coefficients weight(dx, dy), relative to the element that is centred on the cell.
void Lowering::emit_filter_fill(std::uint32_t index, const std::function<double(double, double)>& weight) {
  const Filter filter = builder_.program().filters[index];
  for (std::uint32_t y = 0; y < filter.height; ++y) {
    for (std::uint32_t x = 0; x < filter.width; ++x) {
      const double dx = static_cast<double>(x) - (filter.width - 1) / 2;
      const double dy = static_cast<double>(y) - (filter.height - 1) / 2;
      builder_.emit(
          Opcode::kFilterSet, {},
          {filter_operand(index), builder_.literal_operand(static_cast<float>(y * filter.width + x)),
           builder_.literal_operand(static_cast<float>(weight(dx, dy)))});
    }
  }
}

}  // namespace apron::compiler
