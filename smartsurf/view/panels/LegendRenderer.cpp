#include "smartsurf/view/panels/LegendRenderer.h"

#include <epoxy/gl.h>

#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

// Restores the previous context: a Window may own one on the same thread.
class ScopedImGuiContext {
 public:
  explicit ScopedImGuiContext(ImGuiContext* context) : previous_(ImGui::GetCurrentContext()) {
    ImGui::SetCurrentContext(context);
  }
  ~ScopedImGuiContext() { ImGui::SetCurrentContext(previous_); }
  ScopedImGuiContext(const ScopedImGuiContext&) = delete;
  ScopedImGuiContext& operator=(const ScopedImGuiContext&) = delete;

 private:
  ImGuiContext* previous_;
};

ImGuiContext* create_imgui_context() {
  ImGuiContext* const previous = ImGui::GetCurrentContext();
  ImGuiContext* const context = ImGui::CreateContext();
  ImGui::SetCurrentContext(previous);
  return context;
}

}  // namespace

LegendRenderer::LegendRenderer(float scale) : scale_(scale), context_(create_imgui_context()) {
  const ScopedImGuiContext scope(context_);
  setup_imgui_style(scale);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

LegendRenderer::~LegendRenderer() {
  {
    const ScopedImGuiContext scope(context_);
    ImGui_ImplOpenGL3_Shutdown();
  }
  ImGui::DestroyContext(context_);
}

void LegendRenderer::draw(const ColourScale& colour_scale, unsigned framebuffer, int width, int height) {
  const ScopedImGuiContext scope(context_);
  ImGuiIO& io = ImGui::GetIO();
  io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
  io.DeltaTime = 1.0f / 60.0f;
  // ImGui needs one frame to determine an auto-sized window's size.
  for (int frame = 0; frame < 2; ++frame) {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui::NewFrame();
    draw_legend(colour_scale, static_cast<float>(height) - 12.0f * scale_, scale_);
    ImGui::Render();
  }
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

}  // namespace smartsurf::view
