#include "smartsurf/view/model/EntityList.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "common/text/Unit.h"
#include "common/text/Words.h"

namespace smartsurf::view {
namespace {

std::vector<std::string> words_of(std::string_view query) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : common::lower_case(std::string(query)) + " ") {
    if (c != ' ') {
      word += c;
    } else if (!word.empty()) {
      words.push_back(std::move(word));
      word.clear();
    }
  }
  return words;
}

bool matches(const std::string& name, const std::vector<std::string>& words) {
  const std::string text = common::lower_case(name);
  return std::ranges::all_of(words, [&](const std::string& word) { return text.find(word) != text.npos; });
}

// "ROW,COLUMN" of a cell of the surface.
std::optional<SceneItem> parse_cell(std::string_view text, const scene::SurfaceSpec& surface) {
  SceneItem cell{SceneItem::Kind::kCell, 0, 0, 0};
  const char* const end = text.data() + text.size();
  const auto row = std::from_chars(text.data(), end, cell.row);
  if (row.ec != std::errc{} || row.ptr == end || *row.ptr != ',') return std::nullopt;
  const auto column = std::from_chars(row.ptr + 1, end, cell.column);
  const bool inside =
      cell.row >= 0 && cell.column >= 0 && cell.row < surface.rows && cell.column < surface.columns;
  return column.ec == std::errc{} && column.ptr == end && inside ? std::optional(cell) : std::nullopt;
}

}  // namespace

const char* shape_name(scene::ShapeKind shape) {
  static constexpr const char* kNames[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};
  return kNames[static_cast<int>(shape)];
}

const std::vector<Entity>& EntityList::find(std::string_view query, const scene::SurfaceSpec& surface,
                                            const FrameInput& input) {
  if (built_ && query == query_ && ids_ == input.snapshot.id && channel_count_ == input.channels.size())
    return entities_;
  built_ = true;
  query_ = query;
  ids_ = input.snapshot.id;
  channel_count_ = input.channels.size();
  entities_.clear();
  if (const auto cell = parse_cell(query, surface))
    entities_.push_back({Entity::Kind::kCell, "cell " + std::string(query), *cell, ""});
  const std::vector<std::string> words = words_of(query);
  for (const Channel& channel : input.channels) {
    std::string name = common::with_unit(channel.name, channel.unit);
    if (matches(name, words))
      entities_.push_back({Entity::Kind::kChannel, std::move(name), {}, channel.name});
  }
  for (const scene::ObjectId id : ids_) {
    const scene::ObjectSpec& object = input.catalogue[id];
    std::string name = std::to_string(id) + (object.label.empty() ? "" : " " + object.label) + ", " +
                       shape_name(object.shape) + (object.fixed ? ", fixed" : "");
    if (matches(name, words))
      entities_.push_back({Entity::Kind::kObject, std::move(name), {SceneItem::Kind::kObject, id, 0, 0}, ""});
  }
  return entities_;
}

}  // namespace smartsurf::view
