#include "smartsurf/view/panels/LegendGui.h"

#include <epoxy/gl.h>

#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

// A window may have a context of its own in this thread.
class CurrentGui {
 public:
  explicit CurrentGui(ImGuiContext* context) : before_(ImGui::GetCurrentContext()) {
    ImGui::SetCurrentContext(context);
  }
  ~CurrentGui() { ImGui::SetCurrentContext(before_); }
  CurrentGui(const CurrentGui&) = delete;
  CurrentGui& operator=(const CurrentGui&) = delete;

 private:
  ImGuiContext* before_;
};

ImGuiContext* make_context() {
  ImGuiContext* const before = ImGui::GetCurrentContext();
  ImGuiContext* const context = ImGui::CreateContext();
  ImGui::SetCurrentContext(before);
  return context;
}

}  // namespace

LegendGui::LegendGui(float scale) : scale_(scale), context_(make_context()) {
  const CurrentGui current(context_);
  set_up_hud(scale);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

LegendGui::~LegendGui() {
  {
    const CurrentGui current(context_);
    ImGui_ImplOpenGL3_Shutdown();
  }
  ImGui::DestroyContext(context_);
}

void LegendGui::draw(const HeatScale& heat, unsigned framebuffer, int width, int height) {
  const CurrentGui current(context_);
  ImGuiIO& io = ImGui::GetIO();
  io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
  io.DeltaTime = 1.0f / 60.0f;
  // A panel takes a frame to find its size.
  for (int frame = 0; frame < 2; ++frame) {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui::NewFrame();
    draw_legend(heat, static_cast<float>(height) - 12.0f * scale_, scale_);
    ImGui::Render();
  }
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

}  // namespace smartsurf::view
