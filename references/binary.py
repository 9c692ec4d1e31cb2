from common import Recipes

RECIPES = Recipes()
