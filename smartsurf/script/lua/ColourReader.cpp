#include <array>
#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

struct NamedColour {
  std::string_view name;
  scene::Colour colour;
};

constexpr std::array<NamedColour, 15> kColours{{
    {"black", {0.05f, 0.05f, 0.05f}},
    {"blue", {0.16f, 0.38f, 0.80f}},
    {"brown", {0.48f, 0.31f, 0.20f}},
    {"cyan", {0.15f, 0.72f, 0.78f}},
    {"gray", {0.50f, 0.50f, 0.50f}},
    {"green", {0.20f, 0.62f, 0.28f}},
    {"grey", {0.50f, 0.50f, 0.50f}},
    {"magenta", {0.80f, 0.20f, 0.66f}},
    {"orange", {0.93f, 0.54f, 0.14f}},
    {"pink", {0.94f, 0.60f, 0.70f}},
    {"purple", {0.49f, 0.27f, 0.68f}},
    {"red", {0.82f, 0.16f, 0.16f}},
    {"silver", {0.75f, 0.75f, 0.77f}},
    {"white", {0.96f, 0.96f, 0.96f}},
    {"yellow", {0.95f, 0.82f, 0.18f}},
}};

scene::Colour from_hex(const std::string& text, const std::string& name) {
  std::uint32_t rgb = 0;
  const char* const end = text.data() + text.size();
  if (text.size() != 7 || std::from_chars(text.data() + 1, end, rgb, 16).ptr != end)
    throw ScriptError(name + " = '" + to_single_line(text.substr(0, 20)) +
                      "': must be '#rrggbb', six hexadecimal digits");
  const auto component = [rgb](int shift) { return static_cast<float>((rgb >> shift) & 0xFFU) / 255.0f; };
  return {component(16), component(8), component(0)};
}

scene::Colour from_name(lua_State* L, int index, const std::string& text, const std::string& name) {
  std::vector<std::string> names;
  for (const NamedColour& known : kColours) {
    if (known.name == text) return known.colour;
    names.emplace_back(known.name);
  }
  const std::string hint = did_you_mean(text, names);
  throw ScriptError(name + " = " + format_value(L, index) + ": no such colour" +
                    (hint.empty() ? "; known: " + join_names(names) + ", '#rrggbb', {r, g, b}" : hint));
}

float check_component(double value, const std::string& name) {
  if (value < 0.0 || value > 1.0)
    throw ScriptError(name + " = " + format_value(value) + ": must be in [0, 1]");
  return static_cast<float>(value);
}

}  // namespace

scene::Colour check_colour(lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) == LUA_TSTRING) {
    const std::string text = check_string(L, index, name);
    return text.starts_with("#") ? from_hex(text, name) : from_name(L, index, text, name);
  }
  const std::string requirement = "a colour's name, '#rrggbb' or {r, g, b}";
  if (lua_type(L, index) != LUA_TTABLE) throw_invalid_value(L, index, name, requirement);
  index = lua_absindex(L, index);
  lua_pushliteral(L, "r");
  lua_rawget(L, index);
  const bool by_name = !lua_isnil(L, -1);
  lua_pop(L, 1);
  std::vector<double> rgb(3, 0.0);
  constexpr std::string_view kParts[] = {"r", "g", "b"};
  if (by_name) {
    const TableReader fields(L, index, name, {"r", "g", "b"});
    for (std::size_t i = 0; i < 3; ++i) {
      fields.read_required(kParts[i], rgb[i]);
    }
  } else {
    rgb = check_numbers(L, index, name, 3, requirement);
  }
  return {check_component(rgb[0], name + "[1]"), check_component(rgb[1], name + "[2]"),
          check_component(rgb[2], name + "[3]")};
}

}  // namespace smartsurf::script
