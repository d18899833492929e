#include "smartsurf/view/panels/DockLayout.h"

#include <algorithm>

#include "common/text/SizeList.h"

namespace smartsurf::view {
namespace {

constexpr float kTallAspect = 1.2f;  // a window that is narrower for its height is tall
constexpr DockSizes kDefaults{290.0f, 230.0f, 320.0f, 190.0f}, kMin{180.0f, 120.0f, 200.0f, 90.0f};
constexpr float kMaxOfWidth = 0.5f, kMaxOfHeight = 2.0f / 3.0f;  // of all docks together

template <class Sizes, class Visitor>
void for_each_size(Sizes& sizes, Visitor visit) {
  visit("side", sizes.side);
  visit("top", sizes.top);
  visit("inspector", sizes.inspector);
  visit("plots", sizes.plots);
}

// In pixels, and no more than there is.
float chosen(float user, float standard, float least, float most, float scale) {
  return std::min(std::max((user > 0.0f ? user : standard), least) * scale, std::max(most, 0.0f));
}

// Cut from an edge of `rest`.
DockRect cut_left(DockRect& rest, float width) {
  const DockRect part{rest.x, rest.y, width, rest.height};
  rest.x += width;
  rest.width -= width;
  return part;
}
DockRect cut_right(DockRect& rest, float width) {
  rest.width -= width;
  return {rest.right(), rest.y, width, rest.height};
}
DockRect cut_top(DockRect& rest, float height) {
  const DockRect part{rest.x, rest.y, rest.width, height};
  rest.y += height;
  rest.height -= height;
  return part;
}
DockRect cut_bottom(DockRect& rest, float height) {
  rest.height -= height;
  return {rest.x, rest.bottom(), rest.width, height};
}

}  // namespace

std::string format_sizes(const DockSizes& sizes) {
  return common::format_size_list([&](const auto& visit) { for_each_size(sizes, visit); });
}

DockSizes parse_sizes(std::string_view text) {
  DockSizes sizes;
  common::parse_size_list(text, [&](const auto& visit) { for_each_size(sizes, visit); });
  return sizes;
}

DockLayout lay_out_docks(float width, float height, const DockContents& contents, const DockSizes& sizes,
                         float scale) {
  DockLayout docks;
  docks.tall = width < kTallAspect * height;
  DockRect rest{0.0f, 0.0f, width, height};
  float free_width = kMaxOfWidth * width, free_height = kMaxOfHeight * height;
  const auto take_height = [&](float wanted) {
    const float taken = std::min(wanted, std::max(free_height, 0.0f));
    free_height -= taken;
    return taken;
  };
  if (contents.panels) {
    docks.bar = cut_bottom(rest, take_height(contents.bar_height));
    const float inspector =
        contents.inspector ? chosen(sizes.inspector, kDefaults.inspector, kMin.inspector, free_width, scale)
                           : 0.0f;
    if (docks.tall) {
      docks.main =
          cut_top(rest, take_height(chosen(sizes.top, kDefaults.top, kMin.top, 0.45f * height, scale)));
      if (contents.inspector) docks.inspector = cut_right(docks.main, inspector);
    } else {
      const float most_side = contents.inspector ? 0.55f * free_width : free_width;
      docks.main = cut_left(rest, chosen(sizes.side, kDefaults.side, kMin.side, most_side, scale));
      if (contents.inspector)
        docks.inspector = cut_right(rest, std::min(inspector, free_width - docks.main.width));
    }
    if (contents.plots)
      docks.plots =
          cut_bottom(rest, take_height(chosen(sizes.plots, kDefaults.plots, kMin.plots, free_height, scale)));
  }
  if (contents.message_height > 0.0f) docks.message = cut_top(rest, take_height(contents.message_height));
  docks.scene = rest;
  return docks;
}

}  // namespace smartsurf::view
