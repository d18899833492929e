// Filters: tables of elements that are laid over every cell.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/compiler/Lowering.h"
#include "apron/syntax/Suggestion.h"

namespace apron::compiler {

using program::Filter;
using program::Opcode;

namespace {

constexpr double kPi = 3.14159265358979323846;

// Elements of weight(dx, dy), dx columns east and dy rows south of the middle, scaled to a sum of 1 if
// wanted.
template <class Weight>
Filter weighted(std::string name, int radius_x, int radius_y, bool normal, const Weight& weight) {
  Filter filter{std::move(name),
                static_cast<std::uint32_t>(2 * radius_x + 1),
                static_cast<std::uint32_t>(2 * radius_y + 1),
                {}};
  std::vector<double> values;
  double sum = 0.0;
  for (int y = -radius_y; y <= radius_y; ++y)
    for (int x = -radius_x; x <= radius_x; ++x) sum += values.emplace_back(weight(x, y));
  for (const double value : values)
    filter.elements.push_back(static_cast<float>(normal ? value / sum : value));
  return filter;
}

}  // namespace

// A constant of at least `low`, of which a filter is made while compiling.
double Lowering::real(const Expression& expression, std::string_view what, double low) {
  const double value = constant(expression, what);
  if (!(value >= low && value <= 1e6)) {
    throw Failure{expression.at, fmt::format("{} must be from {} to {}, not {}", what, low, 1e6, value)};
  }
  return value;
}

std::optional<std::uint32_t> Lowering::filter_of(std::string_view name) const {
  const std::vector<Filter>& all = emitter_.program().filters;
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Filter& one) { return one.name == name; });
  if (found == all.end()) return std::nullopt;
  return static_cast<std::uint32_t>(found - all.begin());
}

std::uint32_t Lowering::find_filter(const Expression& name) const {
  const std::string& wanted = text(name, "a filter's name");
  if (const std::optional<std::uint32_t> index = filter_of(wanted)) return *index;
  std::vector<std::string> known;
  for (const Filter& one : emitter_.program().filters) known.push_back(one.name);
  throw Failure{name.at, fmt::format("no filter '{}' was created before{}", wanted,
                                     syntax::did_you_mean(wanted, known))};
}

// The filter's index; one that was made of constants alone is used again.
std::uint32_t Lowering::add_filter(Filter wanted) {
  std::vector<Filter>& all = emitter_.program().filters;
  const auto same = [&](const Filter& one) {
    return one.name == wanted.name && one.width == wanted.width && one.elements == wanted.elements;
  };
  const auto found = std::find_if(all.begin(), all.end(), same);
  if (found != all.end()) return static_cast<std::uint32_t>(found - all.begin());
  all.push_back(std::move(wanted));
  return static_cast<std::uint32_t>(all.size() - 1);
}

Value Lowering::filtered(const Builtin& builtin, const Expressions& arguments, Location at,
                         Destination* destination) {
  constexpr std::string_view kWhat = "a filter";
  if (builtin.form == Form::kFilterGauss) return gauss(arguments, at, destination);
  std::uint32_t index = 0;
  if (builtin.form == Form::kFilterDo) {
    index = find_filter(arguments[1]);
  } else if (builtin.form == Form::kFilterEdge) {
    index = add_filter({"$edge", 3, 3, {-1, -1, -1, -1, 8, -1, -1, -1, -1}});
  } else {
    const double along = real(arguments[1], "the width of a Gaussian", 0.01);
    const double across = real(arguments[2], "the width of a Gaussian", 0.01);
    const double angle = constant(arguments[3], "the angle of a Gaussian");
    const int radius = radius_of(std::max(along, across), arguments[1].at);
    index = add_filter(weighted(fmt::format("$ani {} {} {}", along, across, angle), radius, radius, true,
                                [&](double x, double y) {
                                  const double u = (x * std::cos(angle) + y * std::sin(angle)) / along;
                                  const double v = (y * std::cos(angle) - x * std::sin(angle)) / across;
                                  return std::exp(-0.5 * (u * u + v * v));
                                }));
  }
  return apart(Opcode::kFilterDo, {array(arguments[0], kWhat)}, {filter(index)}, destination, at);
}

// Three times the width on either side.
int Lowering::radius_of(double width, Location at) const {
  const double radius = std::ceil(3.0 * width);
  if (2.0 * radius + 1.0 > static_cast<double>(program::kMaxFilterSide)) {
    throw Failure{at, fmt::format("a filter has at most {0}x{0} elements, and a width of {1} needs more",
                                  program::kMaxFilterSide, width)};
  }
  return static_cast<int>(radius);
}

// By rows, then by columns: the same as one round filter, in fewer steps.
Value Lowering::gauss(const Expressions& arguments, Location at, Destination* destination) {
  const double width = real(arguments[1], "the width of a Gaussian", 0.01);
  const int radius = radius_of(width, arguments[1].at);
  const auto bell = [&](double x, double y) { return std::exp(-0.5 * (x * x + y * y) / (width * width)); };
  const std::uint32_t row = add_filter(weighted(fmt::format("$gauss {}", width), radius, 0, true, bell));
  const std::uint32_t column = add_filter(weighted(fmt::format("$gauss {}", width), 0, radius, true, bell));
  const Value source = array(arguments[0], "a filter");
  const Value rows = apart(Opcode::kFilterDo, {source}, {filter(row)}, nullptr, at);
  return apart(Opcode::kFilterDo, {rows}, {filter(column)}, destination, at);
}

// Whether the statement is one of filters.
bool Lowering::filter_statement(const Builtin& builtin, const Expression& call,
                                const Expressions& arguments) {
  switch (builtin.form) {
    case Form::kFilterCreate: {
      const std::string& name = text(arguments[0], "a filter's name");
      const int width = whole(arguments[1], "a filter's width");
      const int height = whole(arguments[2], "a filter's height");
      const int most = static_cast<int>(program::kMaxFilterSide);
      if (width < 1 || height < 1 || width > most || height > most) {
        throw Failure{call.at, fmt::format("a filter is of 1x1 to {0}x{0} elements", most)};
      }
      if (filter_of(name)) throw Failure{call.at, fmt::format("there is a filter '{}' already", name)};
      const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
      emitter_.program().filters.push_back({name, static_cast<std::uint32_t>(width),
                                            static_cast<std::uint32_t>(height),
                                            std::vector<float>(count, 0.0F)});
      return true;
    }
    case Form::kFilterSet:
      return set_element(arguments), true;
    case Form::kFilterFill: {
      const std::uint32_t index = find_filter(arguments[0]);
      const Filter& wanted = emitter_.program().filters[index];
      const std::uint32_t side = arguments.size() == 10 ? 3 : 5;
      if (wanted.width != side || wanted.height != side) {
        throw Failure{arguments[0].at, fmt::format("the filter '{}' is of {}x{} elements, not {}x{}",
                                                   wanted.name, wanted.width, wanted.height, side, side)};
      }
      for (std::size_t i = 1; i < arguments.size(); ++i) {
        const Value value = scalar(arguments[i], "a filter's element");
        emitter_.emit(Opcode::kFilterSet, {},
                      {filter(index), emitter_.literal(static_cast<float>(i - 1)), emitter_.operand(value)});
        emitter_.release(value);
      }
      return true;
    }
    case Form::kFilterGabor:
      return gabor(arguments), true;
    default:
      return false;
  }
}

// filter.setElement(name, x, y, v): column x, row y; a run-time column is checked by the element's number
// only.
void Lowering::set_element(const Expressions& arguments) {
  constexpr std::string_view kWhat = "'filter.setElement'";
  const std::uint32_t index = find_filter(arguments[0]);
  const Filter wanted = emitter_.program().filters[index];
  const Value x = scalar(arguments[1], kWhat);
  const Value y = scalar(arguments[2], kWhat);
  const auto check = [&](const Value& value, std::uint32_t size, const Expression& place) {
    if (!value.is_constant()) return;
    if (value.constant >= 0.0F && value.constant < static_cast<float>(size) &&
        value.constant == std::floor(value.constant)) {
      return;
    }
    throw Failure{place.at, fmt::format("the filter '{}' is of {}x{} elements, counted from 0", wanted.name,
                                        wanted.width, wanted.height)};
  };
  check(x, wanted.width, arguments[1]);
  check(y, wanted.height, arguments[2]);
  const Value width = Value::of(static_cast<float>(wanted.width));
  const Value above = elementwise(Opcode::kMul, {y, width}, arguments[2].at, nullptr);
  const Value number = elementwise(Opcode::kAdd, {above, x}, arguments[1].at, nullptr);
  const Value value = scalar(arguments[3], kWhat);
  emitter_.emit(Opcode::kFilterSet, {}, {filter(index), emitter_.operand(number), emitter_.operand(value)});
}

// filter.kernel.gabor(name, width, angle, wavelength[, phase[, aspect]]) fills the filter, or makes it as
// large as the width asks.
void Lowering::gabor(const Expressions& arguments) {
  const std::string& name = text(arguments[0], "a filter's name");
  const double width = real(arguments[1], "a Gabor filter's width", 0.01);
  const double angle = constant(arguments[2], "a Gabor filter's angle");
  const double wave = real(arguments[3], "a Gabor filter's wavelength", 0.01);
  const double phase = arguments.size() > 4 ? constant(arguments[4], "a Gabor filter's phase") : 0.0;
  const double aspect = arguments.size() > 5 ? real(arguments[5], "a Gabor filter's aspect", 0.01) : 1.0;
  const auto weight = [&](double x, double y) {
    const double u = x * std::cos(angle) + y * std::sin(angle);
    const double v = y * std::cos(angle) - x * std::sin(angle);
    return std::exp(-0.5 * (u * u + aspect * aspect * v * v) / (width * width)) *
           std::cos(2.0 * kPi * u / wave + phase);
  };
  if (const std::optional<std::uint32_t> index = filter_of(name)) return fill(*index, weight);
  const int radius = radius_of(width / std::min(aspect, 1.0), arguments[1].at);
  add_filter(weighted(name, radius, radius, false, weight));
}

// All elements of weight(dx, dy), from the middle that the machine lays on the cell.
void Lowering::fill(std::uint32_t index, const std::function<double(double, double)>& weight) {
  const Filter wanted = emitter_.program().filters[index];
  for (std::uint32_t y = 0; y < wanted.height; ++y) {
    for (std::uint32_t x = 0; x < wanted.width; ++x) {
      const double dx = static_cast<double>(x) - (wanted.width - 1) / 2;
      const double dy = static_cast<double>(y) - (wanted.height - 1) / 2;
      emitter_.emit(Opcode::kFilterSet, {},
                    {filter(index), emitter_.literal(static_cast<float>(y * wanted.width + x)),
                     emitter_.literal(static_cast<float>(weight(dx, dy)))});
    }
  }
}

}  // namespace apron::compiler
