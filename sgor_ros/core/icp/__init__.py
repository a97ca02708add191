"""Fits to the clouds: of many poses on keypoints (`point_to_plane`), of one by GICP (`gicp`)."""
