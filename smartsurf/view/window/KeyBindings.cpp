#include "smartsurf/view/window/KeyBindings.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

namespace smartsurf::view {
namespace {

struct CharacterBinding {
  char character;  // lower case; matches the capital too
  UiAction action;
};
constexpr CharacterBinding kCharacterBindings[] = {
    {' ', UiAction::kPause},         {'+', UiAction::kFaster},     {'=', UiAction::kFaster},
    {'-', UiAction::kSlower},        {'_', UiAction::kSlower},     {'m', UiAction::kMaxPace},
    {'1', UiAction::kTop},           {'2', UiAction::kIso},        {'3', UiAction::kSide},
    {'w', UiAction::kWireframe},     {'g', UiAction::kGrid},       {'t', UiAction::kTrails},
    {'f', UiAction::kContactForces}, {'s', UiAction::kSensorRays}, {'c', UiAction::kNextChannel},
    {'l', UiAction::kLabels},        {'o', UiAction::kEntities},   {'p', UiAction::kPlots},
    {'v', UiAction::kVideo},         {'q', UiAction::kQuit}};

struct KeyCodeBinding {
  int code;
  UiAction action;
  bool repeats;
};
constexpr KeyCodeBinding kKeyCodeBindings[] = {
    {GLFW_KEY_RIGHT, UiAction::kStep, true},       {GLFW_KEY_LEFT, UiAction::kStepBack, true},
    {GLFW_KEY_BACKSPACE, UiAction::kReset, false}, {GLFW_KEY_TAB, UiAction::kPanels, false},
    {GLFW_KEY_F9, UiAction::kStopBridges, false},  {GLFW_KEY_F12, UiAction::kScreenshot, false},
    {GLFW_KEY_F1, UiAction::kHelp, false},         {GLFW_KEY_ESCAPE, UiAction::kEscape, false}};

}  // namespace

std::optional<UiAction> action_for_character(unsigned character) {
  const unsigned lower = character >= 'A' && character <= 'Z' ? character - 'A' + 'a' : character;
  for (const CharacterBinding& entry : kCharacterBindings)
    if (lower == static_cast<unsigned>(entry.character)) return entry.action;
  return std::nullopt;
}

std::optional<UiAction> action_for_key_code(int code, bool repeated) {
  for (const KeyCodeBinding& entry : kKeyCodeBindings)
    if (entry.code == code && (!repeated || entry.repeats)) return entry.action;
  return std::nullopt;
}

}  // namespace smartsurf::view
