#include "smartsurf/mesh/GltfCheck.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

using nlohmann::json;

constexpr int kFloatComponents = 5126;  // GL_FLOAT

// The JSON of the file, or "" if it is not glTF. A binary file begins with 12 bytes, the length of its JSON,
// its type.
std::string json_text(const std::filesystem::path& file) {
  constexpr std::size_t kLengthAt = 12, kTextAt = 20;
  std::ifstream in(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(in), {});
  if (text.starts_with("glTF") && text.size() > kTextAt) {
    std::uint32_t length = 0;
    std::memcpy(&length, text.data() + kLengthAt, sizeof length);
    return text.substr(kTextAt, length);
  }
  const std::size_t first = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return first != text.npos && text[first] == '{' ? text : std::string();
}

// Only the top-level members that are checked: others may be large.
json parse_checked_members(const std::string& text) {
  const auto keep = [](int depth, json::parse_event_t event, json& value) {
    return depth != 1 || event != json::parse_event_t::key || value == "extensionsRequired" ||
           value == "meshes" || value == "accessors";
  };
  return json::parse(text, keep, false);
}

const json& member(const json& object, const char* name) {
  static const json kNone;
  const auto found = object.is_object() ? object.find(name) : object.end();
  return found != object.end() ? *found : kNone;
}

// glTF 1 refers to the members of an object by name, glTF 2 to the elements of an array by number.
const json& referred(const json& list, const json& reference) {
  static const json kNone;
  if (reference.is_string()) return member(list, reference.get_ref<const std::string&>().c_str());
  const bool is_there =
      list.is_array() && reference.is_number_unsigned() && reference.get<std::uint64_t>() < list.size();
  return is_there ? list[reference.get<std::size_t>()] : kNone;
}

// Appearance is not read.
bool is_of_appearance(std::string_view extension) {
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{"_material", "_texture_", "_light", "_xmp"},
      [&](std::string_view part) { return extension.find(part) != extension.npos; });
}

void check_extensions(const json& required) {
  for (const json& entry : required) {
    if (!entry.is_string()) continue;
    const std::string& name = entry.get_ref<const std::string&>();
    // The importer decodes Draco's meshes, or says that it cannot; of quantized ones the positions are
    // checked.
    if (name == "KHR_draco_mesh_compression" || name == "KHR_mesh_quantization" || is_of_appearance(name))
      continue;
    throw scene::InputError("needs the glTF extension " + name +
                            ", which is not supported: export it without");
  }
}

void check_positions(const json& meshes, const json& accessors) {
  for (const json& mesh : meshes)
    for (const json& primitive : member(mesh, "primitives")) {
      const json& position = member(member(primitive, "attributes"), "POSITION");
      const json& type = member(referred(accessors, position), "componentType");
      if (type.is_number() && type != kFloatComponents)
        throw scene::InputError(
            "has positions that are not 32-bit floats: export it without quantization "
            "(KHR_mesh_quantization)");
    }
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

}  // namespace

void check_gltf(const std::filesystem::path& file) {
  const json gltf = parse_checked_members(json_text(file));
  check_extensions(member(gltf, "extensionsRequired"));
  check_positions(member(gltf, "meshes"), member(gltf, "accessors"));
}

std::string decode_uri(std::string_view uri) {
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool is_escape = uri[i] == '%' && i + 2 < uri.size();
    const int high = is_escape ? hex_value(uri[i + 1]) : -1, low = is_escape ? hex_value(uri[i + 2]) : -1;
    const bool is_character = high >= 0 && low >= 0 && high + low > 0;  // no name has a NUL
    name += is_character ? static_cast<char>(high * 16 + low) : uri[i];
    if (is_character) i += 2;
  }
  return name;
}

}  // namespace smartsurf::mesh
