"""trdlab: when does an agent expect which reward, and how far can that be trusted?"""

__version__ = "0.1.0"
