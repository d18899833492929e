#include "smartsurf/record/Plot.h"

#include <cairo-svg.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "smartsurf/record/PurityPlot.h"
#include "smartsurf/record/TrajectoryPlot.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelsAPoint = 2.0;

using MakeFigure = std::unique_ptr<Figure> (*)(const Recording&);

template <class Kind>
std::unique_ptr<Figure> make(const Recording& recording) {
  return std::make_unique<Kind>(recording);
}

struct Definition {
  PlotKind kind;
  const char* name;
  MakeFigure make;
};
// A new figure is a Figure and a line here.
constexpr Definition kDefinitions[] = {{PlotKind::kTrajectories, "trajectories", make<TrajectoryPlot>},
                                       {PlotKind::kPurity, "purity", make<PurityPlot>}};

cairo_status_t append(void* text, const unsigned char* bytes, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), length);
  return CAIRO_STATUS_SUCCESS;
}

void check_drawn(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("drawing failed: ") + cairo_status_to_string(status));
}

struct SurfaceCloser {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceCloser>;

void draw_on(cairo_surface_t* surface, const Figure& figure, double scale) {
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> paper(cairo_create(surface), cairo_destroy);
  cairo_scale(paper.get(), scale, scale);
  use(paper.get(), kWhite);
  cairo_paint(paper.get());
  figure.draw(paper.get());
  check_drawn(cairo_status(paper.get()));
}

std::string as_svg(const Figure& figure) {
  std::string bytes;
  const Surface surface(cairo_svg_surface_create_for_stream(append, &bytes, figure.width(), figure.height()));
  draw_on(surface.get(), figure, 1.0);
  cairo_surface_finish(surface.get());
  check_drawn(cairo_surface_status(surface.get()));
  return bytes;
}

std::string as_png(const Figure& figure) {
  std::string bytes;
  const Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(figure.width() * kPixelsAPoint)),
      static_cast<int>(std::ceil(figure.height() * kPixelsAPoint))));
  draw_on(surface.get(), figure, kPixelsAPoint);
  check_drawn(cairo_surface_write_to_png_stream(surface.get(), append, &bytes));
  return bytes;
}

void write_whole(const fs::path& path, const std::string& bytes) {
  const fs::path part = path.string() + ".part" + std::to_string(::getpid());
  std::error_code error;
  errno = 0;
  bool good = !fs::is_directory(path, error);
  if (!good) errno = EISDIR;
  if (good) {
    std::ofstream file(part, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    good = file.good();
  }
  const int reason = errno;
  if (good) fs::rename(part, path, error);
  if (good && !error) return;
  std::string why = !good ? std::strerror(reason) : error.message();
  fs::remove(part, error);
  throw scene::InputError(path.string() + ": cannot be written: " + why);
}

}  // namespace

std::vector<std::string> plot_kinds() {
  std::vector<std::string> names;
  for (const Definition& definition : kDefinitions) names.emplace_back(definition.name);
  return names;
}

PlotKind plot_kind(const std::string& name) {
  for (const Definition& definition : kDefinitions)
    if (name == definition.name) return definition.kind;
  std::string known;
  for (const std::string& each : plot_kinds()) known += (known.empty() ? "" : ", ") + each;
  const std::string near = scene::nearest_name(name, plot_kinds());
  throw scene::InputError("unknown plot '" + name + "': known are " + known +
                          (near.empty() ? "" : "; did you mean '" + near + "'?"));
}

void plot(const Recording& recording, PlotKind kind, const fs::path& path) {
  const std::string ending = path.extension().string();
  if (ending != ".svg" && ending != ".png")
    throw scene::InputError(path.string() + ": unknown kind of picture '" + ending +
                            "': the name must end in .svg or .png");
  if (!recording.has_objects())
    throw scene::InputError(recording.path().string() +
                            ": has no object poses: the run recorded no frame, or its "
                            "experiment says record { objects = false }");
  for (const Definition& definition : kDefinitions) {
    if (definition.kind != kind) continue;
    const std::unique_ptr<Figure> figure = definition.make(recording);
    write_whole(path, ending == ".svg" ? as_svg(*figure) : as_png(*figure));
  }
}

}  // namespace smartsurf::record
