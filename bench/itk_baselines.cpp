#include "baselines.hpp"

#include <benchmark/benchmark.h>
#include <itkGDCMImageIO.h>
#include <itkGDCMSeriesFileNames.h>
#include <itkHessianRecursiveGaussianImageFilter.h>
#include <itkHessianToObjectnessMeasureImageFilter.h>
#include <itkImage.h>
#include <itkImageSeriesReader.h>
#include <itkImportImageFilter.h>

#include <algorithm>
#include <vector>

namespace xraycast::bench {

void vesselness_by_itk(const Cube& cube, const std::vector<double>& scales_mm) {
  using Image = itk::Image<float, 3>;
  using Hessian = itk::HessianRecursiveGaussianImageFilter<Image>;
  using Objectness = itk::HessianToObjectnessMeasureImageFilter<Hessian::OutputImageType, Image>;
  const auto importer = itk::ImportImageFilter<float, 3>::New();
  const auto size = static_cast<itk::SizeValueType>(cube.grid.size.x);
  importer->SetRegion({{size, size, size}});
  const double spacing[] = {cube.grid.spacing_mm.x, cube.grid.spacing_mm.y, cube.grid.spacing_mm.z};
  importer->SetSpacing(spacing);
  importer->SetImportPointer(const_cast<float*>(cube.hu.data()), cube.hu.size(), false);
  std::vector<float> best(cube.hu.size());
  for (const double scale_mm : scales_mm) {
    const auto hessian = Hessian::New();
    hessian->SetInput(importer->GetOutput());
    hessian->SetSigma(scale_mm);
    hessian->SetNormalizeAcrossScale(true);
    const auto objectness = Objectness::New();
    objectness->SetInput(hessian->GetOutput());
    objectness->SetObjectDimension(1);
    objectness->Update();
    const float* here = objectness->GetOutput()->GetBufferPointer();
    for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::max(best[i], here[i]);
  }
  benchmark::DoNotOptimize(best.data());
}

void read_series_by_itk(const std::filesystem::path& folder) {
  using Image = itk::Image<std::int16_t, 3>;
  const auto names = itk::GDCMSeriesFileNames::New();
  names->SetDirectory(folder.string());
  const auto reader = itk::ImageSeriesReader<Image>::New();
  reader->SetImageIO(itk::GDCMImageIO::New());
  reader->SetFileNames(names->GetInputFileNames());
  reader->Update();
  benchmark::DoNotOptimize(reader->GetOutput()->GetBufferPointer());
}

}  // namespace xraycast::bench
