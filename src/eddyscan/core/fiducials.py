"""The printed fiducial sheet: a ChArUco board whose squares give views absolute poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class FiducialSheet:
    """A ChArUco board on paper; the default fits A3 with a margin.

    Its frame: origin at the printed corner of square (0, 0), x along the columns,
    y along the rows, z into the paper (OpenCV's board frame) [mm].

    Attributes
    ----------
    columns, rows : number of squares
    square_mm, marker_mm : edge lengths
    dictionary : name of an OpenCV ArUco dictionary
    """

    columns: int = 14
    rows: int = 9
    square_mm: float = 28.0
    marker_mm: float = 21.0
    dictionary: str = "DICT_5X5_250"

    @property
    def size_mm(self) -> tuple[float, float]:
        """Return width and height of the printed board [mm]."""
        return self.columns * self.square_mm, self.rows * self.square_mm

    def board(self) -> Any:
        """Return OpenCV's CharucoBoard [mm], for detectors."""
        import cv2

        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_mm, self.marker_mm, dictionary)

    def image(self, px_per_mm: float) -> NDArray[np.uint8]:
        """Return the board as printed, without margin: (H, W) uint8, black 0 and white 255."""
        width, height = (round(px_per_mm * size) for size in self.size_mm)
        return np.asarray(self.board().generateImage((width, height), marginSize=0), dtype=np.uint8)
