#include "apron/program/Keys.h"

#include <cctype>
#include <utility>
#include <vector>

#include "common/text/Suggestion.h"
#include "common/text/Words.h"

namespace apron::program {
namespace {

constexpr std::pair<std::string_view, int> kNamedKeys[] = {
    {"left", kLeftKey}, {"up", kUpKey}, {"right", kRightKey}, {"down", kDownKey}, {"space", ' '},
    {"enter", '\r'},    {"tab", '\t'},  {"escape", 27},       {"backspace", 8}};

}  // namespace

std::optional<int> key_code(std::string_view name) {
  if (name.size() == 1 && name[0] > ' ' && name[0] <= '~')
    return std::tolower(static_cast<unsigned char>(name[0]));
  for (const auto& [known, code] : kNamedKeys)
    if (known == name) return code;
  return std::nullopt;
}

std::string unknown_key_message(std::string_view name) {
  std::vector<std::string> known;
  for (const auto& [key, code] : kNamedKeys) known.emplace_back(key);
  const std::string hint = common::did_you_mean(name, known);
  return "there is no key '" + std::string(name) + "'" +
         (hint.empty() ? "; the keys are the visible characters and " + common::join(known) : hint);
}

}  // namespace apron::program
