#include "smartsurf/record/plot/ChartFile.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/files/ReadFile.h"
#include "common/index/Index.h"
#include "common/text/Suggestion.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxCells = 32767;  // of an image across and down: Cairo's limit

[[noreturn]] void fail(const std::string& reason) { throw scene::InputError(reason); }

// The fields of one object of the description; `name` is its place in it: "layers[2]".
class Fields {
 public:
  Fields(const json& object, std::string name, const std::vector<std::string>& known)
      : object_(object), name_(std::move(name)) {
    if (!object_.is_object()) fail((name_.empty() ? "a chart" : name_) + ": must be an object");
    for (const auto& [key, value] : object_.items())
      if (std::ranges::find(known, key) == known.end())
        fail(place(key) + ": no such field" + common::did_you_mean(key, known));
  }

  // Leaves `value` as it is if there is no such field.
  template <class Value>
  void read(const char* key, Value& value) const {
    const auto field = object_.find(key);
    if (field == object_.end()) return;
    try {
      value = field->get<Value>();
    } catch (const json::exception&) {
      fail(place(key) + " = " + field->dump() + ": is of another type");
    }
  }

  // Numbers; NaN for null, where it may stand.
  void read_numbers(const char* key, std::vector<double>& values, bool nullable = false) const {
    const auto field = object_.find(key);
    if (field == object_.end()) return;
    if (!field->is_array()) fail(place(key) + ": must be a list of numbers");
    for (const json& value : *field) {
      if (!value.is_number() && !(nullable && value.is_null()))
        fail(place(key) + "[" + std::to_string(values.size()) + "] = " + value.dump() + ": must be a number" +
             (nullable ? " or null" : ""));
      values.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
    }
  }

  const json* find(const char* key) const {
    const auto field = object_.find(key);
    return field == object_.end() ? nullptr : &*field;
  }
  std::string place(const std::string& key) const { return name_.empty() ? key : name_ + "." + key; }

 private:
  const json& object_;
  std::string name_;
};

Rgba parse_color(const std::string& text, const std::string& place) {
  unsigned r = 0, g = 0, b = 0;
  int end = 0;
  if (std::sscanf(text.c_str(), "#%2x%2x%2x%n", &r, &g, &b, &end) != 3 || end != std::ssize(text))
    fail(place + " = '" + text + "': must be a colour like #1f4e79");
  return {r / 255.0, g / 255.0, b / 255.0};
}

ChartAxis read_axis(const json& object, const std::string& name) {
  const Fields fields(object, name, {"title", "scale", "domain", "categories"});
  ChartAxis axis;
  std::string scale = "linear";
  fields.read("title", axis.title);
  fields.read("scale", scale);
  fields.read("categories", axis.categories);
  if (scale != "linear" && scale != "log")
    fail(fields.place("scale") + " = '" + scale + "': must be linear or log");
  axis.log = scale == "log";
  if (std::vector<double> domain; fields.find("domain") != nullptr) {
    fields.read_numbers("domain", domain);
    if (domain.size() != 2 || !(domain[0] < domain[1] || domain[0] > domain[1]) ||
        (axis.log && std::min(domain[0], domain[1]) <= 0.0))
      fail(fields.place("domain") + ": must be two different numbers" + (axis.log ? " above 0" : ""));
    axis.domain = {domain[0], domain[1]};
  }
  return axis;
}

void read_image(const Fields& fields, ChartLayer& layer) {
  std::vector<std::string> colors;
  fields.read("values", layer.values);
  fields.read("colors", colors);
  fields.read("labels", layer.labels);
  for (const std::string& color : colors) layer.colors.push_back(parse_color(color, fields.place("colors")));
  if (layer.values.empty() || layer.values.front().empty())
    fail(fields.place("values") + ": must be rows of numbers");
  if (const std::size_t most = std::max(layer.values.size(), layer.values.front().size()); most > kMaxCells)
    fail(fields.place("values") + ": has " + std::to_string(most) + " rows or columns: must have at most " +
         std::to_string(kMaxCells));
  if (layer.labels.size() > colors.size()) fail(fields.place("labels") + ": are more than the colours");
  for (const std::vector<int>& row : layer.values) {
    if (row.size() != layer.values.front().size())
      fail(fields.place("values") + ": must be rows of equal length");
    for (const int value : row)
      if (value < 0 || value >= std::ssize(colors))
        fail(fields.place("values") + " holds " + std::to_string(value) + ": there is no such colour");
  }
}

ChartLayer read_layer(const json& object, const std::string& name) {
  const Fields fields(object, name,
                      {"mark", "name", "color", "point", "x", "y", "values", "colors", "labels"});
  constexpr std::pair<const char*, ChartLayer::Mark> kMarks[] = {{"line", ChartLayer::Mark::kLine},
                                                                 {"point", ChartLayer::Mark::kPoint},
                                                                 {"bar", ChartLayer::Mark::kBar},
                                                                 {"rect", ChartLayer::Mark::kRect}};
  ChartLayer layer;
  std::string mark, color;
  fields.read("mark", mark);
  const auto known =
      std::ranges::find(kMarks, mark, [](const auto& entry) { return std::string(entry.first); });
  if (known == std::end(kMarks))
    fail(fields.place("mark") + " = '" + mark + "': must be line, point, bar or rect");
  layer.mark = known->second;
  fields.read("name", layer.name);
  fields.read("color", color);
  fields.read("point", layer.point);
  if (!color.empty()) layer.color = parse_color(color, fields.place("color"));
  fields.read_numbers("x", layer.x);
  fields.read_numbers("y", layer.y, true);
  if (layer.mark == ChartLayer::Mark::kRect)
    read_image(fields, layer);
  else if (layer.mark != ChartLayer::Mark::kBar && layer.x.size() != layer.y.size())
    fail(fields.place("y") + ": must be as long as x");
  return layer;
}

void require_categories(const ChartSpec& chart, const std::string& place) {
  for (std::size_t i = 0; i < chart.layers.size(); ++i) {
    const ChartLayer& layer = chart.layers[i];
    const std::string y = place + "[" + std::to_string(i) + "].y";
    if (layer.mark != ChartLayer::Mark::kBar || layer.y.size() <= chart.x.categories.size()) continue;
    fail(y + " has " + std::to_string(layer.y.size()) + " bars: " +
         (chart.x.categories.empty() ? "x.categories must name them"
                                     : "x.categories are only " + std::to_string(chart.x.categories.size())));
  }
}

// Cells are 1 wide.
void require_cells(const ChartSpec& chart, const ChartAxis& axis, const std::string& place) {
  constexpr double kLeast = 0.01;
  const bool has_cells = std::ranges::count(chart.layers, ChartLayer::Mark::kRect, &ChartLayer::mark) > 0;
  if (has_cells && axis.domain && std::abs((*axis.domain)[1] - (*axis.domain)[0]) < kLeast)
    fail(place + ".domain: must be at least 0.01 of a cell of the rect");
}

// An axis of decades shows numbers above 0, which the cells of an image are not.
void require_shown(const std::vector<ChartLayer>& layers, std::vector<double> ChartLayer::*values,
                   const ChartAxis& axis, const std::string& place) {
  if (axis.log && std::ranges::count(layers, ChartLayer::Mark::kRect, &ChartLayer::mark) > 0)
    fail(place + ".scale = 'log': must be linear, because the cells of a rect begin at -0.5");
  if (!axis.log || !axis.categories.empty()) return;
  bool has_values = false;
  for (const ChartLayer& layer : layers)
    for (const double value : layer.*values) {
      if (value > 0.0) return;
      has_values |= std::isfinite(value);
    }
  if (has_values) fail(place + ".scale = 'log': must be linear, because no value is above 0");
}

ChartSpec read_chart(const json& object, const std::string& name) {
  const Fields fields(object, name, {"title", "subtitle", "width", "height", "x", "y", "layers"});
  ChartSpec chart;
  fields.read("title", chart.title);
  fields.read("subtitle", chart.subtitle);
  fields.read("width", chart.width);
  fields.read("height", chart.height);
  for (const double size : {chart.width, chart.height})
    if (!(size >= 150.0 && size <= 5000.0))
      fail(fields.place("width and height") + ": must be from 150 to 5000");
  if (const json* axis = fields.find("x")) chart.x = read_axis(*axis, fields.place("x"));
  if (const json* axis = fields.find("y")) chart.y = read_axis(*axis, fields.place("y"));
  const json* const layers = fields.find("layers");
  if (layers == nullptr || !layers->is_array() || layers->empty())
    fail(fields.place("layers") + ": must be a list of layers");
  for (const json& layer : *layers)
    chart.layers.push_back(
        read_layer(layer, fields.place("layers[" + std::to_string(chart.layers.size()) + "]")));
  require_categories(chart, fields.place("layers"));
  require_cells(chart, chart.x, fields.place("x"));
  require_cells(chart, chart.y, fields.place("y"));
  require_shown(chart.layers, &ChartLayer::x, chart.x, fields.place("x"));
  require_shown(chart.layers, &ChartLayer::y, chart.y, fields.place("y"));
  return chart;
}

ChartFigure read_figure(const json& object) {
  if (!object.is_object() || !object.contains("panels")) return ChartFigure(read_chart(object, ""));
  const Fields fields(object, "", {"title", "panels", "columns"});
  std::string title;
  int columns = 1;
  fields.read("title", title);
  fields.read("columns", columns);
  if (columns < 1) fail("columns: must be at least 1");
  const json& panels = *fields.find("panels");
  if (!panels.is_array() || panels.empty()) fail("panels: must be a list of charts");
  std::vector<ChartSpec> charts;
  for (const json& panel : panels)
    charts.push_back(read_chart(panel, "panels[" + std::to_string(charts.size()) + "]"));
  return {std::move(title), std::move(charts), columns};
}

}  // namespace

ChartFigure read_chart_file(const std::filesystem::path& path) {
  try {
    std::string text;
    if (const auto error = common::read_file(path, common::kMaxTextBytes, text))
      fail("cannot be read: " + error.message());
    return read_figure(json::parse(text));
  } catch (const json::exception& error) {
    throw scene::InputError(path.string() + ": is not JSON: " + error.what());
  } catch (const scene::InputError& error) {
    throw scene::InputError(path.string() + ": " + error.what());
  }
}

}  // namespace smartsurf::record
