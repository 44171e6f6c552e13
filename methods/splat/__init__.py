# SPDX-License-Identifier: Apache-2.0
"""Flat Gaussian discs (surfels, "2D Gaussian splatting"): hold them, store them, draw them."""

from graycard.methods.splat._depth_normal import depth_normal_map as depth_normal_map
from graycard.methods.splat._depth_normal import depth_to_normals as depth_to_normals
from graycard.methods.splat._initialise import surfels_from_points as surfels_from_points
from graycard.methods.splat._losses import l1_map as l1_map
from graycard.methods.splat._losses import photometric_map as photometric_map
from graycard.methods.splat._losses import ssim_map as ssim_map
from graycard.methods.splat._maps import FeatureMaps as FeatureMaps
from graycard.methods.splat._maps import Maps as Maps
from graycard.methods.splat._maps import ndc_depth as ndc_depth
from graycard.methods.splat._rasterize import Backend as Backend
from graycard.methods.splat._rasterize import rasterize as rasterize
from graycard.methods.splat._rasterize import rasterize_features as rasterize_features
from graycard.methods.splat._rays import Rays as Rays
from graycard.methods.splat._rays import Traced as Traced
from graycard.methods.splat._rays import camera_rays as camera_rays
from graycard.methods.splat._store import export_ply as export_ply
from graycard.methods.splat._store import load_surfels as load_surfels
from graycard.methods.splat._store import save_surfels as save_surfels
from graycard.methods.splat._surfels import Surfels as Surfels
from graycard.methods.splat._trace import build_bvh as build_bvh
from graycard.methods.splat._trace import trace as trace
