#pragma once

#include "xraycast/base/dicom_file.hpp"

/// The elements of DICOM files that the readers of slices and frames use, by their keywords (PS3.6) where
/// those are short.
namespace xraycast {

inline constexpr DicomTag kMediaClass = 0x00020002, kTransferSyntax = 0x00020010, kImageType = 0x00080008,
                          kObjectClass = 0x00080016, kObjectInstance = 0x00080018, kStudyDate = 0x00080020,
                          kModality = 0x00080060, kSeriesDescription = 0x0008103e, kPatientName = 0x00100010,
                          kPatientId = 0x00100020, kPatientBirthDate = 0x00100030,
                          kBodyPartExamined = 0x00180015, kSliceThickness = 0x00180050,
                          kStudyUid = 0x0020000d, kSeriesUid = 0x0020000e, kSeriesNumber = 0x00200011,
                          kImagePosition = 0x00200032, kImageOrientation = 0x00200037,
                          kSamplesPerPixel = 0x00280002, kNumberOfFrames = 0x00280008, kRows = 0x00280010,
                          kColumns = 0x00280011, kPixelSpacing = 0x00280030, kBitsAllocated = 0x00280100,
                          kBitsStored = 0x00280101, kHighBit = 0x00280102, kPixelRepresentation = 0x00280103,
                          kRescaleIntercept = 0x00281052, kRescaleSlope = 0x00281053, kPixelData = 0x7fe00010;

// The functional groups of multi-frame files, and what identifies a frame (PS3.3, C.7.6.16).
inline constexpr DicomTag kStackId = 0x00209056, kFrameContent = 0x00209111, kPlanePosition = 0x00209113,
                          kPlaneOrientation = 0x00209116, kTemporalIndex = 0x00209128,
                          kPixelMeasures = 0x00289110, kPixelValueTransformation = 0x00289145,
                          kSharedGroups = 0x52009229, kPerFrameGroups = 0x52009230;

// The segments of Segmentations (PS3.3, C.8.20).
inline constexpr DicomTag kSpacingBetweenSlices = 0x00180088, kSegments = 0x00620002,
                          kSegmentNumber = 0x00620004, kSegmentLabel = 0x00620005,
                          kSegmentIdentification = 0x0062000a, kReferencedSegment = 0x0062000b;

// The delimiters of sequences (PS3.5, 7.5).
inline constexpr DicomTag kItem = 0xfffee000, kItemEnd = 0xfffee00d, kSequenceEnd = 0xfffee0dd;

}  // namespace xraycast
